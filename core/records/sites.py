"""Anatomic sites of the skin: DICOM CID 4029, as shipped inside pydicom."""

from __future__ import annotations

from functools import lru_cache

from core.errors import InputError
from core.records.records import AnatomicSite

_NOT_SKIN = {"Cornea", "Eyelash", "Hair", "Iris", "Retina", "Sclera", "Tooth"}


@lru_cache(maxsize=1)
def anatomic_sites() -> tuple[AnatomicSite, ...]:
    """Every site of CID 4029 Dermatology Anatomic Site, sorted by the name shown to a person."""
    from pydicom.sr.codedict import codes

    context = codes.cid4029
    entries = [getattr(context, name) for name in context.dir()]
    sites = [AnatomicSite(str(e.value), str(e.scheme_designator), str(e.meaning)) for e in entries]
    return tuple(sorted(sites, key=lambda site: (site.name.casefold(), site.code)))


@lru_cache(maxsize=1)
def skin_sites() -> tuple[AnatomicSite, ...]:
    """The sites of CID 4029 where a skin lesion can be marked (no teeth, hair or inner eye)."""
    return tuple(site for site in anatomic_sites() if site.meaning not in _NOT_SKIN)


@lru_cache(maxsize=1)
def _by_code() -> dict[tuple[str, str], AnatomicSite]:
    return {(site.scheme, site.code): site for site in anatomic_sites()}


def find_site(code: str, scheme: str | None = None) -> AnatomicSite:
    """The site with this code; ``scheme`` (SCT, FMA, DCM) is needed only where a code is in two schemes.

    Raises
    ------
    InputError
        If CID 4029 has no such code.
    """
    for (its_scheme, its_code), site in _by_code().items():
        if its_code == code and scheme in (None, its_scheme):
            return site
    raise InputError(f"The anatomic site code {code} is not in DICOM CID 4029.", "Choose a site of the list.")
