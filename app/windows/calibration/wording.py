"""A calibration in words and table rows: parameters with their uncertainty, verdict, cameras."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from app.theme import palette
from app.widgets.tables import Row

if TYPE_CHECKING:
    from core.calibration.profile import CalibrationProfile
    from core.calibration.verdict import Verdict
    from core.capture.camera import PinholeCamera

HEADLINES = {
    "good": "This calibration is good",
    "usable": "This calibration can be used",
    "refused": "This calibration is not good enough to be used",
}

_INTRINSICS = (
    ("fx", "Focal length, across"),
    ("fy", "Focal length, down"),
    ("cx", "Optical centre, across"),
    ("cy", "Optical centre, down"),
)
_DISTORTION = ("k1", "k2", "p1", "p2", "k3")


def _figure(value: float, digits: int, unit: str) -> str:
    if not math.isfinite(value):
        return "not known"
    least = 10.0**-digits
    return f"under {least:g} {unit}" if value < 0.5 * least else f"{value:.{digits}f} {unit}"


def _sigma(value: float | None, digits: int, unit: str, factor: float = 1.0) -> str:
    """Twice the standard deviation: the 95 % bound people can use."""
    if value is None or not math.isfinite(value):
        return ""
    return f"± {2 * factor * value:.{digits}f} {unit}".rstrip()


def parameter_rows(profile: CalibrationProfile) -> list[Row]:
    """Every parameter with its 95 % uncertainty."""
    rig, sigma = profile.rig, profile.sigma
    rows = _camera_rows("depth", "Depth", rig.depth, sigma)
    if rig.color is not None and rig.color_from_depth is not None:
        rows += _camera_rows("color", "Colour", rig.color, sigma)
        turn = math.degrees(
            math.acos(float(np.clip((np.trace(rig.color_from_depth.rotation) - 1) / 2, -1.0, 1.0)))
        )
        rows.append(
            _row(
                "turn", "Between the cameras: turn", f"{turn:.2f}°", _sigma(sigma.get("rotation_deg"), 3, "°")
            )
        )
        for axis, way, value in zip(
            "xyz", ("right", "down", "forward"), rig.color_from_depth.inverse().translation, strict=True
        ):
            rows.append(
                _row(
                    f"t{axis}",
                    f"Colour camera, to the {way}" if axis == "x" else f"Colour camera, {way}",
                    f"{1000 * value:.1f} mm",
                    _sigma(sigma.get(f"translation_{axis}_m"), 1, "mm", 1000.0),
                )
            )
    correction = profile.depth_correction
    rows.append(
        _row("scale", "Depth, scale", f"{correction.scale:.4f}", _sigma(sigma.get("depth_scale"), 4, ""))
    )
    rows.append(
        _row(
            "offset",
            "Depth, offset",
            f"{1000 * correction.offset_m:.1f} mm",
            _sigma(sigma.get("depth_offset_m"), 1, "mm", 1000.0),
        )
    )
    return rows


def _camera_rows(name: str, title: str, camera: PinholeCamera, sigma: Mapping[str, float]) -> list[Row]:
    rows = [
        _row(
            f"{name}.{key}",
            f"{title}: {words[0].lower()}{words[1:]}",
            f"{getattr(camera, key):.1f} px",
            _sigma(sigma.get(f"{name}.{key}"), 2, "px"),
        )
        for key, words in _INTRINSICS
    ]
    for key, value in zip(_DISTORTION, camera.distortion, strict=False):
        if f"{name}.{key}" in sigma:
            rows.append(
                _row(
                    f"{name}.{key}",
                    f"{title}: distortion {key}",
                    f"{value:.5f}",
                    _sigma(sigma.get(f"{name}.{key}"), 5, ""),
                )
            )
    return rows


def _row(key: str, name: str, value: str, bound: str) -> Row:
    return Row(key, (name, value, bound), colors={2: palette.SECONDARY})


def figures(verdict: Verdict) -> list[tuple[str, str, str]]:
    """Key, value and what it means, of the three figures people can use."""
    return [
        (
            "picture",
            _figure(verdict.picture_mm, 1, "mm"),
            "picture against depth at 2.3 m (95 %)",
        ),
        ("depth", _figure(verdict.depth_mm, 0, "mm"), "error of the distance to the patient (95 %)"),
        ("length", _figure(verdict.length_percent, 2, "%"), "error of lengths on the body (95 %)"),
    ]


def rms_in_words(rms_px: Mapping[str, float]) -> str:
    """Reprojection error while collecting."""
    if not rms_px:
        return "after 5 views"
    names = {"depth": "infrared", "color": "colour"}
    return ", ".join(f"{names[k]} {v:.2f} px" for k, v in rms_px.items() if k in names)
