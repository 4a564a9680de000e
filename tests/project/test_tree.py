"""What holds for the tree as a whole."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


def _tracked() -> list[Path]:
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=False)
    if listed.returncode != 0:
        pytest.skip("not a git checkout")
    return [ROOT / name for name in listed.stdout.decode().split("\0") if name]


def test_the_lock_is_hashed_and_names_no_registry() -> None:
    text = (ROOT / "requirements.lock").read_text()
    assert "://" not in text
    assert "--index-url" not in text
    pinned = re.findall(r"^[A-Za-z0-9._-]+==[^\s;]+", text, re.MULTILINE)
    assert len(pinned) > 50
    assert text.count("--hash=sha256:") > len(pinned)


def test_every_dependency_of_the_project_is_in_requirements_in() -> None:
    import tomllib

    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    declared = {re.split(r"[<>=;\s\[]", d)[0].lower() for d in project["dependencies"]}
    lines = (ROOT / "requirements.in").read_text().splitlines()
    required = {re.split(r"[<>=;\s\[]", n)[0].lower() for n in lines if n and not n.startswith("#")}
    assert declared == required


def test_the_top_level_is_that_of_the_design() -> None:
    allowed = {
        "pyproject.toml", "app", "core", "devices", "resources", "tests", "docs", "README.md",
        "Makefile", "LICENSE", "NOTICE", "requirements.in", "requirements-dev.in",
        "requirements-overrides.txt", "requirements.lock",
    }  # fmt: skip
    top = {p.relative_to(ROOT).parts[0] for p in _tracked()}
    assert {name for name in top if not name.startswith(".")} <= allowed


@pytest.mark.parametrize("folder", ["bodies", "models", "fonts"])
def test_data_made_by_others_has_a_notice_beside_it(folder: str) -> None:
    names = {p.name.split(".")[0].upper() for p in (ROOT / "resources" / folder).rglob("*") if p.is_file()}
    assert names & {"NOTICE", "LICENSE", "OFL", "README"}


HEAVY = (
    "open3d",
    "mediapipe",
    "pyvista",
    "vtkmodules",
    "numba",
    "scipy",
    "sqlalchemy",
    "pydicom",
    "reportlab",
    "dask",
    "distributed",
    "matplotlib",
    "threadpoolctl",
)


@pytest.mark.parametrize("module", ["core.capture", "app.cli.main", "app.context", "devices.registry"])
def test_importing_it_costs_no_heavy_library(module: str) -> None:
    code = f"import sys, {module}; print([m for m in {HEAVY!r} if m in sys.modules])"
    printed = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert printed.stdout.strip() == "[]"


def test_the_help_costs_no_library_but_typer() -> None:
    code = (
        "import sys; from app.cli.main import main; main(['--help']); "
        f"sys.stderr.write(str([m for m in {(*HEAVY, 'numpy', 'cv2')!r} if m in sys.modules]))"
    )
    ran = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert "relocate-batch" in ran.stdout
    assert ran.stderr == "[]"
