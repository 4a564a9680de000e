"""A hand with a marker before the cameras: true depth, raw frames, colour picture, visible points."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from core.capture.rgbd import CameraRig, RgbdCapture
from core.capture.transform import RigidTransform
from core.hand.labels import FrameLabels
from core.hand.names import POINT_NAMES
from devices.simulator.hands.model import HandModel, skin_below
from devices.simulator.hands.rendering import HandScene
from devices.simulator.room import SimulatedRig
from devices.simulator.sensor import DEPTH_UNIT_M, FrameMaker

FloatArray = NDArray[np.float64]

_QUIET_CELLS = 1


@dataclass(frozen=True)
class MarkerSheet:
    """The printed marker on the back of the hand.

    Attributes
    ----------
    side_m : float
        Of the black square.
    number : int
        Of the dictionary.
    dictionary : str
        Name in cv2.aruco.
    turn_deg : float
        How it was stuck on: turn about the hand's z.
    shift_m : tuple of float
        Its middle in the hand frame, x and y.
    """

    side_m: float = 0.036
    number: int = 7
    dictionary: str = "DICT_4X4_50"
    turn_deg: float = 0.0
    shift_m: tuple[float, float] = (0.0, 0.0)

    def brightness(self, xy: FloatArray) -> FloatArray:
        """Reflectance (n,) of places (n, 2) on the sheet, hand frame; NaN beside it."""
        a = np.deg2rad(self.turn_deg)
        turned = (xy - self.shift_m) @ np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]])
        picture = _marker_picture(self.dictionary, self.number)
        cells = len(picture)
        scale = (cells - 2 * _QUIET_CELLS) / self.side_m
        column = np.floor(turned[:, 0] * scale + cells / 2).astype(np.int64)
        row = np.floor(-turned[:, 1] * scale + cells / 2).astype(np.int64)
        inside = (column >= 0) & (row >= 0) & (column < cells) & (row < cells)
        out = np.full(len(xy), np.nan)
        out[inside] = picture[row[inside], column[inside]]
        return out

    def corners(self) -> FloatArray:
        """Corners (4, 2) in the hand frame, in ArUco's order: top left first, clockwise on the sheet."""
        h = 0.5 * self.side_m
        square = np.array([(-h, h), (h, h), (h, -h), (-h, -h)])
        a = np.deg2rad(self.turn_deg)
        return np.asarray(square @ np.array([[np.cos(a), np.sin(a)], [-np.sin(a), np.cos(a)]]) + self.shift_m)


@lru_cache(maxsize=8)
def _marker_picture(dictionary: str, number: int) -> FloatArray:
    """Cells of the sheet, 0.03 black to 0.92 white, with a quiet zone around."""
    known = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, dictionary))
    cells = known.markerSize + 2
    black = cv2.aruco.generateImageMarker(known, number, cells).astype(float) / 255.0
    framed = np.pad(black, _QUIET_CELLS, constant_values=1.0)
    return np.asarray(0.03 + 0.89 * framed)


@dataclass(frozen=True, eq=False)
class Thing:
    """Something else in view: a bottle, a body, a table. Depth camera frame."""

    vertices: FloatArray
    triangles: NDArray[np.int32]
    color: tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class HandView:
    """A hand held before the camera.

    Attributes
    ----------
    model : HandModel
    vertices : ndarray (n, 3)
        Posed, hand frame.
    depth_from_hand : RigidTransform
    marker : sequence of MarkerSheet
        None, one, or more.
    things : sequence of Thing
    wall_m : float
        Distance of the background; 0 for none.
    tone : int
        Row of `devices.simulator.skin.TONES`.
    blur_px, blur_turn_rad : float
        Motion blur of the colour picture: its length, and its direction from x toward y.
    """

    model: HandModel
    vertices: FloatArray
    depth_from_hand: RigidTransform
    markers: tuple[MarkerSheet, ...] = (MarkerSheet(),)
    things: tuple[Thing, ...] = ()
    wall_m: float = 1.4
    tone: int = 1
    blur_px: float = 0.0
    blur_turn_rad: float = 0.0


@dataclass(frozen=True, eq=False)
class HandFrame:
    """One frame and the truth about it.

    Attributes
    ----------
    capture : RgbdCapture
    points_m : dict of str to ndarray (3,)
        The 15 points on the skin, depth-camera frame.
    visible : dict of str to bool
        Whether the depth camera sees the point.
    corners_m : ndarray (k, 4, 3)
        Of the markers, on the skin.
    configuration : str or None
        What the hand does; None between two configurations.
    time_s : float
        Of a sequence.
    remark : str
        What happens in this frame of a sequence, in words; empty in most.
    """

    capture: RgbdCapture
    points_m: dict[str, FloatArray]
    visible: dict[str, bool]
    corners_m: FloatArray = field(default_factory=lambda: np.zeros((0, 4, 3)))
    configuration: str | None = None
    time_s: float = 0.0
    remark: str = ""

    def labels(self) -> FrameLabels:
        """The truth as somebody would label the frame."""
        return FrameLabels(self.configuration, self.points_m, self.visible)


def take_frame(view: HandView, rig: SimulatedRig, rng: np.random.Generator) -> HandFrame:
    """One depth frame and one colour picture of a hand."""
    scene = HandScene(view)
    depth, sight = scene.depth(rig)
    raw = FrameMaker(rig.sensor, sight, rig.device_seed, rng).frame(depth)
    rgb = scene.picture(rig.color, rig.color_from_depth, rng)
    capture = RgbdCapture(
        raw[None],
        DEPTH_UNIT_M,
        CameraRig(rig.rig.depth, rig.rig.color, rig.rig.color_from_depth),
        rgb,
        stance="hand",
    )
    points, seen = true_points(view, scene, rig)
    return HandFrame(capture, points, seen, marker_corners(view))


def true_points(
    view: HandView, scene: HandScene, rig: SimulatedRig
) -> tuple[dict[str, FloatArray], dict[str, bool]]:
    """The 15 points on the skin, depth-camera frame, and whether the depth camera sees them."""
    points = {name: view.depth_from_hand.apply(p) for name, p in view.model.points(view.vertices).items()}
    seen = scene.visible(rig.rig.depth, np.array([points[name] for name in POINT_NAMES]))
    return points, dict(zip(POINT_NAMES, map(bool, seen), strict=True))


def marker_corners(view: HandView) -> FloatArray:
    """Marker corners (k, 4, 3) on the skin, depth frame: the sheet follows the back of the hand."""
    found = np.zeros((len(view.markers), 4, 3))
    for k, sheet in enumerate(view.markers):
        triangle, weights = _corner_places(view.model, sheet)
        corners = view.vertices[view.model.triangles[triangle]]
        found[k] = view.depth_from_hand.apply(np.einsum("kc,kcx->kx", weights, corners))
    return found


@lru_cache(maxsize=32)
def _corner_places(model: HandModel, sheet: MarkerSheet) -> tuple[NDArray[np.int64], FloatArray]:
    """Triangle (4,) and weights (4, 3) of a marker's corners; NaN weights beside the hand."""
    above = np.column_stack([sheet.corners(), np.full(4, 0.1)])
    return skin_below(model.reference, model.triangles, above, np.tile((0.0, 0.0, -1.0), (4, 1)))
