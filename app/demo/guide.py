"""The pictures of the user guide, from the pictures of a demonstration."""

from __future__ import annotations

import subprocess
from pathlib import Path

from core.errors import WorkError

GUIDE_PICTURES = (
    "login", "patients", "patient", "stance_assistant", "stance", "countdown", "capture", "mark", "review",
    "follow_up", "explain", "compare", "calibration",
)  # fmt: skip
_COLORS = 255
_REPORT_WIDTH = 620


def write_guide_pictures(pictures: Path, report: Path, guide: Path) -> None:
    """Write small PNG files for the guide.

    Parameters
    ----------
    pictures : Path
        Screenshots of a demonstration.
    report : Path
        Its report; the first two pages are shown.
    guide : Path
        Folder of the guide's pictures.
    """
    from PIL import Image

    guide.mkdir(parents=True, exist_ok=True)
    for name in GUIDE_PICTURES:
        with Image.open(pictures / f"{name}.png") as picture:
            _write(picture.convert("RGB"), guide / f"{name}.png")
    pages = [_page(report, number, guide) for number in (1, 2)]
    sheet = Image.new("RGB", (sum(p.width for p in pages) + 20, max(p.height for p in pages)), "#E1E6E9")
    sheet.paste(pages[0], (0, 0))
    sheet.paste(pages[1], (pages[0].width + 20, 0))
    _write(sheet, guide / "report.png")


def _page(report: Path, number: int, folder: Path):  # type: ignore[no-untyped-def]
    """One page of a PDF as a picture, drawn by poppler's ``pdftoppm``."""
    from PIL import Image

    target = folder / f"page-{number}"
    command = ["pdftoppm", "-png", "-singlefile", "-f", str(number), "-scale-to-x", str(_REPORT_WIDTH)]
    try:
        subprocess.run([*command, "-scale-to-y", "-1", str(report), str(target)], check=True)
    except (OSError, subprocess.CalledProcessError) as error:
        raise WorkError(
            "The report could not be drawn for the guide.",
            "Install pdftoppm (apt-get install poppler-utils).",
        ) from error
    file = target.with_suffix(".png")
    with Image.open(file) as page:
        loaded = page.convert("RGB")
    file.unlink()
    return loaded


def _write(picture, path: Path) -> None:  # type: ignore[no-untyped-def]
    picture.quantize(_COLORS).save(path, optimize=True)
