"""Calibration from 25 rendered views of the printed board, against the true cameras behind them.

Every run has a rig of its own: focal lengths, principal points, lens distortion, the way the colour camera is
mounted, the scale and offset of the depth, and the device's depth ripple are all drawn anew and hidden.
Pictures have blur, noise and vignetting; raw depth has the structured-light sensor's noise, steps and ripple.
The board is exact: flat, and its size known; the error of measuring it comes on top and is part of the stated
uncertainty (0.03 % unless told otherwise). Errors are absolute; "within 2 sigma" is the share of true errors
that lie within twice the stated standard deviation, over all runs of all rigs, which should be near 95 %.

Kinect: 640 x 480 infrared and colour, A3 board, 0.55 to 1.15 m away. Moving: the same views with the corners
of each picture moved together by 0.2 pixels (RMS an axis), as by a hand that is not quite still between two
exposures. Auxiliary: infrared 640 x 480 with a 1920 x 1440 colour camera mounted up to 1.5 degrees askew.
"""

from __future__ import annotations

import time
from dataclasses import replace
from functools import lru_cache
from typing import Any

import cv2
import numpy as np

VIEWS = 25
BARS = {
    "focal length": (0.3, "%"),
    "principal point": (1.5, "px"),
    "translation between cameras": (1.5, "mm"),
    "rotation between cameras": (0.1, "deg"),
    "depth scale": (0.2, "%"),
    "depth offset": (float("nan"), "mm"),
    "depth at 1 m": (float("nan"), "mm"),
}
RIGS: dict[str, dict[str, Any]] = {
    "Kinect": {"size": (640, 480), "paper": "A3", "runs": 10},
    "Kinect, moving": {"size": (640, 480), "paper": "A3", "runs": 10, "hand_px": 0.2},
    "auxiliary": {"size": (1920, 1440), "paper": "A3", "runs": 3},
}


@lru_cache(maxsize=16)
def _views(
    size: tuple[int, int], paper: str, seed: int, coarse: bool, count: int = VIEWS
) -> tuple[Any, Any, list[Any], float]:
    """Rig, board, views of it, and the processor time of finding the board in a picture."""
    from core.calibration.board import BoardSpec, detect_board
    from core.calibration.views import view_of
    from devices.simulator.boards import BoardRenderer, PictureQuality, good_poses, random_board_rig

    board_rig, spec = random_board_rig(seed, size), BoardSpec.for_paper(paper)
    if coarse:
        board_rig = replace(
            board_rig,
            color_quality=PictureQuality(1.5, 0.03),
            infrared_quality=PictureQuality(1.5, 0.06, 0.45, 1.0),
        )
    renderer = BoardRenderer(board_rig, spec, seed)
    near_far = (0.55, 1.15) if paper == "A3" else (0.40, 0.85)
    views, spent, pictures = [], 0.0, 0
    for pose in good_poses(board_rig, spec, 2 * count, seed, near_far):
        if len(views) == count:
            break
        seen = renderer.render(pose)
        started = time.process_time()
        infrared, color = (detect_board(image, spec, thorough=True) for image in (seen.infrared, seen.rgb))
        spent, pictures = spent + time.process_time() - started, pictures + 2
        if infrared is not None and color is not None:
            views.append(view_of(infrared, color, seen.depth, 0.001))
    return board_rig, spec, views, spent / pictures


def _unsteady(views: list[Any], hand_px: float, seed: int) -> list[Any]:
    """The views with the corners of each picture moved together."""
    rng = np.random.default_rng((0xBE4C, seed))
    return [
        replace(
            view,
            infrared=replace(view.infrared, pixels=view.infrared.pixels + rng.normal(0, hand_px, 2)),
            color=replace(view.color, pixels=view.color.pixels + rng.normal(0, hand_px, 2)),
        )
        for view in views
    ]


def _errors(solution: Any, board_rig: Any) -> dict[str, list[tuple[float, float]]]:
    """(error, stated sigma) by figure."""
    rig, true, sigma = solution.rig, board_rig.rig, solution.sigma
    out: dict[str, list[tuple[float, float]]] = {name: [] for name in BARS}
    for name, mine, real in (("depth", rig.depth, true.depth), ("color", rig.color, true.color)):
        for axis in "xy":
            f = getattr(real, f"f{axis}")
            out["focal length"].append(
                (100 * (getattr(mine, f"f{axis}") / f - 1), 100 * sigma[f"{name}.f{axis}"] / f)
            )
            out["principal point"].append(
                (getattr(mine, f"c{axis}") - getattr(real, f"c{axis}"), sigma[f"{name}.c{axis}"])
            )
    off = rig.color_from_depth.translation - true.color_from_depth.translation
    for axis, value in zip("xyz", off, strict=True):
        out["translation between cameras"].append((1000 * value, 1000 * sigma[f"translation_{axis}_m"]))
    turn = cv2.Rodrigues(rig.color_from_depth.rotation @ true.color_from_depth.rotation.T)[0]
    out["rotation between cameras"].append((float(np.rad2deg(np.linalg.norm(turn))), sigma["rotation_deg"]))
    mine, real = solution.depth_correction, board_rig.depth_error
    out["depth scale"].append((100 * (mine.scale - real.scale), 100 * sigma["depth_scale"]))
    out["depth offset"].append((1000 * (mine.offset_m - real.offset_m), 1000 * sigma["depth_offset_m"]))
    at = {n: k for k, n in enumerate(solution.names)}
    ab = [at["correction.scale"], at["correction.offset"]]
    at_1m = np.sqrt(np.array([1.0, 1.0]) @ solution.covariance[np.ix_(ab, ab)] @ np.array([1.0, 1.0]))
    error = mine.scale - real.scale + mine.offset_m - real.offset_m
    out["depth at 1 m"].append((1000 * error, 1000 * float(at_1m)))
    return out


def run(quick: bool = False) -> list[dict[str, Any]]:
    """Measure; see the module's docstring."""
    from core.calibration.solve import solve_rig

    rows: list[dict[str, Any]] = []
    inside: dict[str, list[float]] = {name: [] for name in BARS}
    detect, solve = [], []
    for title, how in RIGS.items():
        found: dict[str, list[list[float]]] = {name: [] for name in BARS}
        used = []
        for seed in range(2 if quick else how["runs"]):
            board_rig, spec, views, spent = _views(how["size"], how["paper"], seed, how.get("coarse", False))
            detect.append(1000 * spent)
            if hand_px := how.get("hand_px"):
                views = _unsteady(views, hand_px, seed)
            started = time.process_time()
            solution = solve_rig(views, spec)
            solve.append(time.process_time() - started)
            used.append(solution.used)
            for name, pairs in _errors(solution, board_rig).items():
                found[name].append([abs(e) for e, _ in pairs])
                # A turn is the length of three errors: 95 % lie within 2.8 sigma of one axis.
                factor = 2.795 / np.sqrt(3) if name.startswith("rotation") else 2.0
                inside[name] += [abs(e) / (factor * s) for e, s in pairs]
            print(
                f"{title} {seed}: {len(views)} views",
                {n: np.round(v[-1], 3).tolist() for n, v in found.items()},
                flush=True,
            )
        for name, runs in found.items():
            worst_of_run = np.array([max(r) for r in runs])
            low, middle, high = np.percentile(worst_of_run, [25, 50, 75])
            bar, unit = BARS[name]
            rows.append(
                {
                    "figure": f"{title}: {name}",
                    "value": float(f"{middle:.3g}"),
                    "unit": unit,
                    "spread": f"{low:.2g}-{high:.2g}",
                    "worst": float(f"{worst_of_run.max():.3g}"),
                    "runs": len(runs),
                    "to reach": "" if np.isnan(bar) else f"{bar} {unit}",
                    "views used": f"{min(used)}-{max(used)}",
                }
            )
    for name, shares in inside.items():
        ratio = np.array(shares)
        rows.append(
            {
                "figure": f"true {name} within 2 sigma",
                "value": round(100 * float((ratio <= 1).mean()), 1),
                "unit": "%",
                "worst": f"{2 * ratio.max():.1f} sigma",
                "runs": len(ratio),
                "to reach": "95 %",
            }
        )
    for name, taken, unit in (
        ("finding the board, processor time", detect, "ms"),
        ("solving 25 views, processor time", solve, "s"),
    ):
        low, middle, high = np.percentile(taken, [25, 50, 75])
        rows.append(
            {
                "figure": name,
                "value": float(f"{middle:.3g}"),
                "unit": unit,
                "spread": f"{low:.3g}-{high:.3g}",
                "runs": len(taken),
            }
        )
    return rows


if __name__ == "__main__":
    for row in run(quick=True):
        print(row)
