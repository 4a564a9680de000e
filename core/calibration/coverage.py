"""What the collected views cover, and what to ask for next."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from core.calibration.board import BoardSpec, BoardView
from core.calibration.views import board_pose, guess_camera, tilt_deg

ROWS, COLUMNS = 3, 4
_CORNERS_A_CELL = 12
_TILTED_DEG = 15.0
_TILTS = ("square", "left", "right", "up", "down")
_WANTED_TILT = {"square": 2, "left": 3, "right": 3, "up": 3, "down": 3}
_WANTED_DISTANCE = 3
_PLACES = (
    ("upper left", "upper middle", "upper middle", "upper right"),
    ("left", "middle", "middle", "right"),
    ("lower left", "lower middle", "lower middle", "lower right"),
)


@dataclass(frozen=True, eq=False)
class CameraCoverage:
    """What the views of one camera cover.

    Attributes
    ----------
    regions : ndarray (3, 4) int
        Corners seen in each region of the picture.
    near, middle, far : int
        Views by the size of the board in the picture.
    tilts : dict of str to int
        Views by direction: square, left, right (that side of the board nearer to the camera), up, down.
    views : int
    """

    regions: NDArray[np.int64]
    near: int
    middle: int
    far: int
    tilts: dict[str, int]
    views: int

    @property
    def share(self) -> float:
        """How much of what is wanted is there, 0 to 1."""
        cells = float((np.minimum(self.regions, _CORNERS_A_CELL) / _CORNERS_A_CELL).mean())
        distances = np.mean(
            [min(n, _WANTED_DISTANCE) / _WANTED_DISTANCE for n in (self.near, self.middle, self.far)]
        )
        tilts = np.mean([min(self.tilts[t], n) / n for t, n in _WANTED_TILT.items()])
        return float(0.5 * cells + 0.2 * distances + 0.3 * tilts)

    def missing(self) -> list[str]:
        """What to ask for, most important first, as sentences."""
        wishes: list[tuple[float, str]] = []
        for row, column in np.argwhere(self.regions < _CORNERS_A_CELL):
            lack = 1 - self.regions[row, column] / _CORNERS_A_CELL
            edge = 1.3 if row != 1 and column in (0, 3) else 1.0
            wishes.append((lack * edge, f"Hold the board in the {_PLACES[row][column]} of the picture"))
        ways = {
            "square": "Hold the board square to the camera",
            "left": "Turn the left side of the board toward the camera, by about 35 degrees",
            "right": "Turn the right side of the board toward the camera, by about 35 degrees",
            "up": "Tip the top of the board toward the camera, by about 35 degrees",
            "down": "Tip the bottom of the board toward the camera, by about 35 degrees",
        }
        for tilt, wanted in _WANTED_TILT.items():
            if self.tilts[tilt] < wanted:
                wishes.append((1.1 * (1 - self.tilts[tilt] / wanted), ways[tilt]))
        for count, text in (
            (self.near, "Come closer: the board should fill half of the picture"),
            (self.middle, "Hold the board at a middle distance"),
            (self.far, "Go farther away: the board should fill a quarter of the picture's width"),
        ):
            if count < _WANTED_DISTANCE:
                wishes.append((0.9 * (1 - count / _WANTED_DISTANCE), text))
        wishes.sort(key=lambda w: -w[0])
        return list(dict.fromkeys(text for _, text in wishes))


def tilt_name(horizontal_deg: float, vertical_deg: float) -> str:
    """Which side of the board is nearer: square, left, right, up or down."""
    if max(abs(horizontal_deg), abs(vertical_deg)) < _TILTED_DEG:
        return "square"
    # The board's axis z points away from the camera: turned to +x, the right side is nearer.
    if abs(horizontal_deg) >= abs(vertical_deg):
        return "right" if horizontal_deg > 0 else "left"
    return "down" if vertical_deg > 0 else "up"


def camera_coverage(views: Sequence[BoardView], spec: BoardSpec) -> CameraCoverage:
    """Coverage of one camera by the views it has."""
    regions = np.zeros((ROWS, COLUMNS), np.int64)
    tilts = dict.fromkeys(_TILTS, 0)
    sizes = [0, 0, 0]
    for view in views:
        width, height = view.size
        column = np.clip((view.pixels[:, 0] + 0.5) / width * COLUMNS, 0, COLUMNS - 1).astype(int)
        row = np.clip((view.pixels[:, 1] + 0.5) / height * ROWS, 0, ROWS - 1).astype(int)
        np.add.at(regions, (row, column), 1)
        pose = board_pose(view, spec, guess_camera(view.size))
        if pose is None:
            continue
        tilts[tilt_name(*tilt_deg(pose))] += 1
        share = guess_camera(view.size).fx * spec.size_m[0] / pose.translation[2] / width
        sizes[0 if share > 0.5 else (1 if share > 0.33 else 2)] += 1
    return CameraCoverage(regions, sizes[0], sizes[1], sizes[2], tilts, len(views))
