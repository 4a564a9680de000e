"""A skeleton that follows the person through live pictures: smooth, patient with losses, sides kept."""

from __future__ import annotations

import threading
from typing import Final, Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from core.anchors.lifting import picture_joints
from core.anchors.live_pose import LiveJoint, LivePose, LiveSource, depths_under, points_at
from core.anchors.names import OPPOSITE_LANDMARKS
from core.anchors.one_euro import HOLD_S, OneEuro, Smoothing
from core.anchors.relief import LAMPS, shade_depth
from core.anchors.skeleton import VISIBLE, PoseLandmarks
from core.capture.camera import PinholeCamera
from core.capture.rgbd import CameraRig
from core.errors import WorkError
from core.surface import segment_body

FloatArray = NDArray[np.float64]

WORKING_SIDE: Final = 640
"""Pictures larger than this are reduced for the tracker, pixels."""

SWAP_PATIENCE_S: Final = 0.6
"""Sides that changed at once are believed after this time."""

JUMP: Final = 0.25
"""A joint that moves farther than this share of the picture's longer side in one step must do so twice."""

_GONE_S: Final = 1.0
_SWAP_GAIN: Final = 0.5
_SWAP_LEAST: Final = 0.03
_BODY_DEPTH_M: Final = 0.8
_OPPOSITE: Final = np.array(OPPOSITE_LANDMARKS)
_PAIRED: Final = np.arange(len(_OPPOSITE)) != _OPPOSITE


class PictureFollower(Protocol):
    """Finds the landmarks of one person in successive pictures; faster and calmer than one at a time."""

    @property
    def name(self) -> str:
        """For people."""

    def follow(self, rgb: NDArray[np.uint8], time_s: float) -> PoseLandmarks | None:
        """Landmarks in the next picture (h, w, 3), or None if nobody is seen."""

    def close(self) -> None:
        """Release it. Closing twice does nothing."""


class LiveSkeleton:
    """Follows one person. Call it from any thread; calls wait for each other.

    Parameters
    ----------
    follower : PictureFollower
        Belongs to this object, which closes it.

    Attributes
    ----------
    closed : bool
    """

    def __init__(self, follower: PictureFollower) -> None:
        self._follower = follower
        self._lock = threading.Lock()
        self.closed = False
        self._names: tuple[str, ...] = ()
        self._places = OneEuro()
        self._depths = OneEuro(Smoothing(rest_hz=1.5, hz_per_speed=4.0))
        self._forget()

    def _forget(self) -> None:
        self._places.reset()
        self._depths.reset()
        self._source: LiveSource | None = None
        self._visibility = np.zeros(0)
        self._shown = np.zeros((0, 2))
        self._suspect = np.zeros(0, dtype=bool)
        self._last: PoseLandmarks | None = None
        self._swapped_since: float | None = None
        self._seen_s = -np.inf

    def reset(self) -> None:
        """Begin anew, for example after another camera was chosen."""
        with self._lock:
            self._forget()

    def close(self) -> None:
        """Release the tracker."""
        with self._lock:
            self.closed = True
            self._follower.close()

    def update(
        self,
        rgb: NDArray[np.uint8] | None,
        time_s: float,
        depth_m: NDArray[np.floating] | None = None,
        rig: CameraRig | None = None,
    ) -> LivePose | None:
        """The skeleton in the next moment.

        Parameters
        ----------
        rgb : ndarray (h, w, 3) uint8 or None
            The colour picture. Without one the depth, drawn as a relief, is looked at (slower).
        time_s : float
            Of the picture.
        depth_m : ndarray (h', w') or None
            Metres; with ``rig``, joints get a place in space.
        rig : CameraRig or None

        Returns
        -------
        LivePose or None
            None if there has been nobody for a second, or there is nothing to look at.

        Raises
        ------
        WorkError
            If the tracker has been closed.
        """
        with self._lock:
            source: LiveSource = "relief" if rgb is None else "color"
            if rgb is None:
                if depth_m is None or rig is None:
                    return None
                rig = CameraRig(rig.depth)
                picture = relief_picture(depth_m, rig.depth)
                size = (rig.depth.width, rig.depth.height)
            else:
                picture = rgb
                size = (rgb.shape[1], rgb.shape[0])
            if source != self._source or time_s - self._seen_s > 4 * _GONE_S:
                self._forget()
                self._source = source
            seen = None if picture is None else _follow(self._follower, picture, size, time_s)
            found = self._sided(seen, time_s, max(size))
            pose = self._smoothed(found, time_s, source, size)
            if pose is None or depth_m is None or rig is None:
                return pose
            return self._lifted(pose, depth_m, rig)

    def _sided(self, found: PoseLandmarks | None, time_s: float, side: int) -> PoseLandmarks | None:
        """The landmarks with left and right as in the picture before, unless the change lasts."""
        last = self._last
        if found is None or last is None or time_s - self._seen_s > HOLD_S:
            self._last, self._swapped_since = found, None
            return found
        exchanged = PoseLandmarks(found.pixels[_OPPOSITE], found.visibility[_OPPOSITE])
        both = (last.visibility >= VISIBLE) & (found.visibility >= VISIBLE)
        pairs = both & both[_OPPOSITE] & _PAIRED
        if pairs.sum() >= 6:
            straight = _moved(last, found, pairs)
            crossed = _moved(last, exchanged, pairs)
            if straight > _SWAP_LEAST * side and crossed < _SWAP_GAIN * straight:
                since = time_s if self._swapped_since is None else self._swapped_since
                if time_s - since < SWAP_PATIENCE_S:
                    self._swapped_since = since
                    self._last = exchanged
                    return exchanged
                self._places.reset()  # believed: jump to the new places instead of gliding through the body
        self._last, self._swapped_since = found, None
        return found

    def _smoothed(
        self, found: PoseLandmarks | None, time_s: float, source: LiveSource, size: tuple[int, int]
    ) -> LivePose | None:
        side = float(max(size))
        pixels: FloatArray | None = None
        seen: FloatArray | None = None
        if found is not None:
            self._seen_s = time_s
            places = picture_joints(found, _frame(size))
            if not self._names:
                self._names = tuple(places)
            pixels = np.array([places[name][0] for name in self._names])
            seen = np.array([places[name][1] for name in self._names])
            measured = np.where((seen >= VISIBLE)[:, None], self._without_jumps(pixels, side), np.nan)
        elif time_s - self._seen_s > _GONE_S or not self._names:
            self._places.reset()
            self._depths.reset()
            self._shown = np.zeros((0, 2))
            return None
        else:
            measured = np.full((len(self._names), 2), np.nan)
        smooth = side * self._places.update(measured / side, time_s)
        age = self._places.age_s(time_s)
        self._shown = smooth
        if seen is not None:
            self._visibility = seen
        joints = {}
        for k, name in enumerate(self._names):
            held = bool(np.isfinite(smooth[k]).all())
            if held:
                now = age[k] == 0.0
                trust = self._visibility[k] if now else VISIBLE * max(0.0, 2.0 - 2.0 * age[k] / HOLD_S)
                joints[name] = LiveJoint(smooth[k], float(min(trust, 1.0)), None, float(age[k]))
            elif pixels is not None and seen is not None and seen[k] > 0.0:
                joints[name] = LiveJoint(pixels[k], float(min(seen[k], VISIBLE - 1e-3)), None, float(age[k]))
        return LivePose(joints, time_s, source, size, time_s - self._seen_s)

    def _without_jumps(self, pixels: FloatArray, side: float) -> FloatArray:
        """Pixels, NaN where a joint leaps for the first time."""
        if self._shown.shape != pixels.shape:
            self._suspect = np.zeros(len(pixels), dtype=bool)
            return pixels
        with np.errstate(invalid="ignore"):
            leaps = np.linalg.norm(pixels - self._shown, axis=1) > JUMP * side
        first = leaps & ~self._suspect
        self._suspect = leaps
        return np.where(first[:, None], np.nan, pixels)

    def _lifted(self, pose: LivePose, depth_m: NDArray[np.floating], rig: CameraRig) -> LivePose:
        pixels = np.full((len(self._names), 2), np.nan)
        for k, name in enumerate(self._names):
            if name in pose.joints:
                pixels[k] = pose.joints[name].pixel
        found = depths_under(pixels, depth_m, rig)
        depths = self._depths.update(found[:, None], pose.time_s)[:, 0]
        points = points_at(self._names, pixels, depths, rig)
        joints = {
            name: LiveJoint(
                joint.pixel,
                joint.visibility,
                points[k] if np.isfinite(points[k]).all() else None,
                joint.age_s,
            )
            for k, name in enumerate(self._names)
            if (joint := pose.joints.get(name)) is not None
        }
        return LivePose(joints, pose.time_s, pose.source, pose.size, pose.age_s)


def relief_picture(depth_m: NDArray[np.floating], camera: PinholeCamera) -> NDArray[np.uint8] | None:
    """Half-size relief of the body in a live depth image; None if there is no body.

    The body is found in a sixteenth of the pixels: floor and wall would draw the tracker away from it.
    """
    quarter = np.asarray(depth_m[::4, ::4], dtype=float)
    try:
        body = segment_body(quarter, _reduced(camera, quarter, 4)).mask
    except WorkError:  # nobody is there: for a live picture that is an answer
        return None
    half = np.asarray(depth_m[::2, ::2], dtype=float)
    wide = cv2.dilate(body.astype(np.uint8), np.ones((3, 3), np.uint8))
    mask = cv2.resize(wide, half.shape[::-1], interpolation=cv2.INTER_NEAREST) > 0
    middle = float(np.median(quarter[body]))
    mask &= np.abs(half - middle) < _BODY_DEPTH_M
    return shade_depth(half, mask, _reduced(camera, half, 2), LAMPS[2])


def _reduced(camera: PinholeCamera, image: NDArray[np.floating], step: int) -> PinholeCamera:
    """The camera of every ``step``-th pixel; the lens matters little to a relief."""
    height, width = image.shape
    return PinholeCamera(
        width, height, camera.fx / step, camera.fy / step, camera.cx / step, camera.cy / step
    )


def _follow(
    follower: PictureFollower, picture: NDArray[np.uint8], size: tuple[int, int], time_s: float
) -> PoseLandmarks | None:
    """Landmarks in pixels of an image of ``size``, looked for in the picture at working size."""
    height, width = picture.shape[:2]
    if max(width, height) > WORKING_SIDE:
        share = WORKING_SIDE / max(width, height)
        to = (max(round(width * share), 1), max(round(height * share), 1))
        picture = np.asarray(cv2.resize(picture, to, interpolation=cv2.INTER_AREA), dtype=np.uint8)
    found = follower.follow(picture, time_s)
    if found is None:
        return None
    scale = np.array([size[0] / picture.shape[1], size[1] / picture.shape[0]])
    return PoseLandmarks((found.pixels + 0.5) * scale - 0.5, found.visibility)


def _moved(last: PoseLandmarks, now: PoseLandmarks, which: NDArray[np.bool_]) -> float:
    return float(np.median(np.linalg.norm(last.pixels[which] - now.pixels[which], axis=1)))


def _frame(size: tuple[int, int]) -> PinholeCamera:
    """An image of this size as a camera, where only its borders matter."""
    width, height = size
    return PinholeCamera(width, height, float(width), float(width), width / 2, height / 2)
