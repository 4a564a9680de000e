"""Calibration from 25 rendered views of the printed board, against the true cameras behind them.

Every run has a rig of its own: focal lengths, principal points, lens distortion, the way the colour camera is
mounted, the scale and offset of the depth, and the device's depth ripple are all drawn anew and hidden.
Pictures have blur, noise and vignetting; raw depth has the structured-light sensor's noise, steps and ripple.
The board is exact: flat, and its size known; the error of measuring it comes on top and is part of the stated
uncertainty (0.03 % unless told otherwise). Errors are absolute; "within 2 sigma" is the share of true errors
that lie within twice the stated standard deviation, over all runs of all rigs, which should be near 95 %.

Kinect: 640 x 480 infrared and colour, A3 board. Auxiliary: infrared 640 x 480 with a 1920 x 1440 colour
camera mounted up to 1.5 degrees askew. A4: the Kinect with the small board. Coarse: the Kinect with blur of
1.5 pixels and three times the noise. Moving: corners moved by 0.2 pixels in each view, differently in the two
cameras, as by a hand that is not quite still between two exposures.
"""

from __future__ import annotations

import time
from dataclasses import replace
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
RIGS = {
    "Kinect": {"size": (640, 480), "paper": "A3", "coarse": False, "hand_px": 0.0},
    "auxiliary": {"size": (1920, 1440), "paper": "A3", "coarse": False, "hand_px": 0.0},
    "Kinect, A4": {"size": (640, 480), "paper": "A4", "coarse": False, "hand_px": 0.0},
    "Kinect, coarse": {"size": (640, 480), "paper": "A3", "coarse": True, "hand_px": 0.0},
    "Kinect, moving": {"size": (640, 480), "paper": "A3", "coarse": False, "hand_px": 0.2},
}


def _views(
    board_rig: Any, spec: Any, seed: int, hand_px: float, count: int = VIEWS
) -> tuple[list[Any], float]:
    from core.calibration.board import detect_board
    from core.calibration.views import view_of
    from devices.simulator.boards import BoardRenderer, good_poses

    renderer = BoardRenderer(board_rig, spec, seed)
    rng = np.random.default_rng((0xBE4C, seed))
    near_far = (0.55, 1.35) if spec.square_m > 0.035 else (0.40, 0.95)
    views, spent = [], 0.0
    for pose in good_poses(board_rig, spec, 2 * count, seed, near_far):
        if len(views) == count:
            break
        seen = renderer.render(pose)
        started = time.process_time()
        infrared, color = (detect_board(image, spec, thorough=True) for image in (seen.infrared, seen.rgb))
        spent += time.process_time() - started
        if infrared is None or color is None:
            continue
        if hand_px:
            infrared = replace(infrared, pixels=infrared.pixels + rng.normal(0, hand_px, 2))
            color = replace(color, pixels=color.pixels + rng.normal(0, hand_px, 2))
        views.append(view_of(infrared, color, seen.depth, 0.001))
    return views, spent / max(2 * len(views), 1)


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
    from core.calibration.board import BoardSpec
    from core.calibration.solve import solve_rig
    from devices.simulator.boards import PictureQuality, random_board_rig

    rows: list[dict[str, Any]] = []
    inside: dict[str, list[float]] = {name: [] for name in BARS}
    detect, solve = [], []
    for title, how in RIGS.items():
        seeds = range(2) if quick else range(20 if title == "Kinect" else 10)
        found: dict[str, list[list[float]]] = {name: [] for name in BARS}
        used = []
        for seed in seeds:
            board_rig = random_board_rig(seed, how["size"])
            if how["coarse"]:
                board_rig = replace(
                    board_rig,
                    color_quality=PictureQuality(1.5, 0.03),
                    infrared_quality=PictureQuality(1.5, 0.06, 0.45, 1.0),
                )
            spec = BoardSpec.for_paper(how["paper"])
            views, spent = _views(board_rig, spec, seed, how["hand_px"])
            detect.append(1000 * spent)
            started = time.process_time()
            solution = solve_rig(views, spec)
            solve.append(time.process_time() - started)
            used.append(solution.used)
            for name, pairs in _errors(solution, board_rig).items():
                found[name].append([abs(e) for e, _ in pairs])
                # A turn is the length of three errors: its bound is that of three, 2.8 sigma / sqrt(3) an axis.
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
