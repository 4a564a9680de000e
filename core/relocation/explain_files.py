"""Explanations as PNG files."""

from __future__ import annotations

import re
from pathlib import Path

import cv2

from core.anchors import AnalysedCapture
from core.errors import WorkError
from core.relocation.explain import LesionExplanation
from core.relocation.explain_draw import draw_explanation


def write_explanation(
    explanation: LesionExplanation,
    first: AnalysedCapture,
    followup: AnalysedCapture,
    folder: Path,
    prefix: str,
) -> tuple[Path, ...]:
    """Write the pictures of one lesion as ``PREFIX-NAME.png``; unusual characters become ``_``.

    Raises
    ------
    WorkError
        If the folder cannot be written.
    """
    stem = re.sub(r"[^\w.-]", "_", prefix)[:80] or "lesion"
    written = []
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, picture in draw_explanation(explanation, first, followup).items():
            ok, data = cv2.imencode(".png", cv2.cvtColor(picture, cv2.COLOR_RGB2BGR))
            if not ok:
                raise WorkError(f"The explanation of {explanation.lesion_id} cannot be encoded as PNG.")
            path = folder / f"{stem}-{name}.png"
            path.write_bytes(data.tobytes())
            written.append(path)
    except OSError as error:
        raise WorkError(
            f"{folder}: cannot be written ({error.strerror or error}).",
            "Choose a folder that you may write to.",
        ) from error
    return tuple(written)
