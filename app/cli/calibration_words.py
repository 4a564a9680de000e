"""What ``geoderm calibrate`` prints: for people, and as JSON."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from app.workflows.calibration_steps import CalibrationResult
    from core.calibration.daily_check import CheckResult
    from core.calibration.profile import CalibrationProfile


def result_report(result: CalibrationResult) -> dict[str, Any]:
    """What ``calibrate run --json`` prints; figures that are not known are null."""
    v = result.verdict
    return {
        "verdict": v.grade,
        "picture_mm": _number(v.picture_mm),
        "depth_mm": _number(v.depth_mm),
        "length_percent": _number(v.length_percent),
        "reasons": list(v.reasons),
        "missing": list(v.missing),
        "saved": False,
        "profile": result.profile.document(),
        "views": [
            {
                "number": r.number,
                "used": r.used,
                "reason": r.reason,
                "infrared_px": _number(r.infrared_px),
                "color_px": _number(r.color_px),
                "depth_mm": _number(1000 * r.depth_m),
            }
            for r in result.views
        ],
    }


def check_report(result: CheckResult) -> dict[str, Any]:
    """What ``calibrate check --json`` prints."""
    names = (
        "shift_px", "limit_px", "rotation_deg", "rotation_sigma_deg", "translation_mm",
        "translation_sigma_mm", "depth_error_mm", "depth_limit_mm",
    )  # fmt: skip
    figures = {name: _number(getattr(result, name)) for name in names}
    return {"verdict": result.verdict, "message": result.message, "views": result.views, **figures}


def _number(value: float) -> float | None:
    return round(float(value), 4) if value == value and abs(value) != float("inf") else None


def result_text(told: dict[str, Any]) -> str:
    """A calibration for people, from its `result_report`."""
    used = sum(v["used"] for v in told["views"])
    lines = [f"Verdict        {told['verdict']}, from {used} of {len(told['views'])} views"]
    for name, text, unit in (
        ("picture_mm", "On the skin", "mm"),
        ("depth_mm", "Distance", "mm"),
        ("length_percent", "Lengths", "%"),
    ):
        value = told[name]
        lines.append(
            f"{text:<15}{'not known' if value is None else f'within {value:.2f} {unit} (95 %, at 2.3 m)'}"
        )
    lines += [f"               {reason}" for reason in told["reasons"]]
    lines += [f"Missing        {wish}." for wish in told["missing"][:5]]
    if told["saved"]:
        p = told["profile"]
        lines.append(f"Profile        {p['id']}, version {p['version']}")
    return "\n".join(lines)


def check_text(result: CheckResult) -> str:
    """A daily check for people."""
    lines = [f"{result.verdict}: {result.message}"]
    if result.shift_px == result.shift_px:
        lines.append(
            f"Colour corners {result.shift_px:.2f} px from their place (limit {result.limit_px:.1f}); "
            f"turn {result.rotation_deg:.2f} degrees or shift {result.translation_mm:.1f} mm."
        )
    if result.depth_error_mm == result.depth_error_mm:
        lines.append(f"Depth {result.depth_error_mm:+.1f} mm off (limit {result.depth_limit_mm:.0f}).")
    return "\n".join(lines)


def profile_text(profile: CalibrationProfile) -> str:
    """A profile for people, each parameter with its standard deviation."""
    import numpy as np

    rig, sigma = profile.rig, profile.sigma
    lines = [
        f"Profile        {profile.id}, version {profile.version}, made {profile.made_at:%Y-%m-%d %H:%M}",
        f"Cameras        {profile.depth_serial}"
        + (f" + {profile.color_serial}" if profile.color_serial else ""),
        f"From           {profile.views} views",
    ]

    def line(title: str, name: str, value: float, unit: str, digits: int = 3, factor: float = 1.0) -> None:
        known = f" +- {factor * sigma[name]:.{digits}f}" if name in sigma else ""
        lines.append(f"{title:<15}{factor * value:.{digits}f}{known} {unit}".rstrip())

    for prefix, camera in (("depth", rig.depth), ("color", rig.color)):
        if camera is None:
            continue
        lines += [
            "",
            f"{'Depth' if prefix == 'depth' else 'Colour'} camera, {camera.width} x {camera.height}",
        ]
        for name in ("fx", "fy", "cx", "cy"):
            line(f"  {name}", f"{prefix}.{name}", getattr(camera, name), "px")
        for name, value in zip(("k1", "k2", "p1", "p2", "k3"), camera.distortion, strict=False):
            line(f"  {name}", f"{prefix}.{name}", value, "", 5)
        if prefix in profile.rms_px:
            lines.append(f"  corners      {profile.rms_px[prefix]:.3f} px RMS")
    if rig.color_from_depth is not None:
        lines += ["", "Colour camera from depth camera"]
        for axis, value in zip("xyz", rig.color_from_depth.translation, strict=True):
            line(f"  {axis}", f"translation_{axis}_m", value, "mm", 2, 1000.0)
        angle = float(
            np.rad2deg(np.arccos(np.clip((np.trace(rig.color_from_depth.rotation) - 1) / 2, -1, 1)))
        )
        line("  turn", "rotation_deg", angle, "degrees")
    lines += ["", "Depth correction"]
    line("  scale", "depth_scale", profile.depth_correction.scale, "", 5)
    line("  offset", "depth_offset_m", profile.depth_correction.offset_m, "mm", 2, 1000.0)
    lines += [f"Note: {note}" for note in profile.notes]
    return "\n".join(lines)
