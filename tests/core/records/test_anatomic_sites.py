from __future__ import annotations

import subprocess
import sys

import pytest

from core.errors import InputError
from core.records import AnatomicSite
from core.records.sites import anatomic_sites, find_site, skin_sites


def test_the_whole_context_group_is_there_with_names_people_say() -> None:
    sites = anatomic_sites()
    assert len(sites) == 207
    assert len({(site.scheme, site.code) for site in sites}) == 207
    assert {site.scheme for site in sites} == {"SCT", "FMA", "DCM"}
    assert not any(site.name.startswith("Skin of") for site in sites)
    assert all(site.name[0].isupper() for site in sites)
    assert [site.name.casefold() for site in sites] == sorted(site.name.casefold() for site in sites)


def test_a_site_is_found_by_its_code() -> None:
    site = find_site("45981001")
    assert site == AnatomicSite("45981001", "SCT", "Skin of anterior surface of upper arm")
    assert site.name == "Anterior surface of upper arm"
    assert find_site("130323", "DCM").name == "Mid back"
    with pytest.raises(InputError, match="CID 4029"):
        find_site("130323", "SCT")


def test_lesions_are_not_offered_teeth() -> None:
    names = {site.name for site in skin_sites()}
    assert "Back" in names
    assert "Tooth" not in names


def test_the_dictionary_and_the_database_load_only_when_needed() -> None:
    code = (
        "import sys, core.records, core.records.sites; "
        "print([m for m in ('pydicom', 'sqlalchemy', 'alembic', 'argon2', 'PIL') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
