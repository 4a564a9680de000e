"""The stillness meter: how far any part of the body has moved within the last second, in millimetres.

Across the line of sight, corners of the picture on the body are followed (Lucas-Kanade); along it, the coarse
depth is compared. Both are taken as averages over parts of the body, so that the sensor's noise, which
changes every pixel of every frame, averages out, while an arm that moves alone is still noticed: the part
that moved most is the answer. The present is compared with several moments of the last second; a to and fro
is not missed. Depth is averaged over three successive moments first, and of what is left only as much counts
as noise of the measured spread does not explain.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Any, Final, cast

import cv2
import numpy as np
from numpy.typing import NDArray

from core.guidance.moment import Moment
from core.guidance.person import Person
from core.guidance.readings import Reading, unknown

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

WINDOW_S: Final = 1.0
STILL_MM: Final = 5.0
"""Movement within a second below which thirty fused frames stay sharp: natural sway is 1 to 4 mm."""

MOVING_MM: Final = 12.0

_LOOKS: Final = (1.0, 0.65, 0.4)
"""Shares of the window at which the past is looked at."""

_AVERAGED: Final = 3
"""Moments whose depth is averaged."""

_NOISE_SIGMAS: Final = 2.0
"""Standard errors of a part's mean that are put down to noise."""

_WIDTH: Final = 320
_ROWS: Final = 4
_COLUMNS: Final = 2
_POINTS: Final = 90
_FEWEST: Final = 4
_FEWEST_DEPTH: Final = 40
_JUMP_M: Final = 0.08
_BODY_M: Final = 0.8
_OUTLINE_PX: Final = 1.2
_OUTLINE_SLOPE: Final = 0.05
_FLOW: Final[dict[str, Any]] = {
    "winSize": (17, 17),
    "maxLevel": 2,
    "criteria": (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 20, 0.01),
}


@dataclass(frozen=True, eq=False)
class _Look:
    time_s: float
    grey: NDArray[np.uint8] | None
    depth_m: FloatArray
    person: BoolArray
    inner: BoolArray
    mm_per_px: float
    depth_mm_per_px: float
    """At the person, in pixels of `grey` and of the depth."""


class StillnessMeter:
    """Fed with successive moments; see the module."""

    def __init__(self) -> None:
        self._past: deque[_Look] = deque()

    def forget(self) -> None:
        """Begin anew, for another person or camera."""
        self._past.clear()

    def update(self, moment: Moment, person: Person | None) -> Reading:
        """Movement of the part of the body that moved most, within the last second."""
        if person is None:
            self.forget()
            return unknown("stillness")
        look = _look(moment, person)
        if self._past and _unlike(look, self._past[-1]):
            self.forget()
        while self._past and look.time_s - self._past[0].time_s > WINDOW_S + 0.15:
            self._past.popleft()
        age = look.time_s - self._past[0].time_s if self._past else 0.0
        if age < 0.6 * WINDOW_S:
            self._past.append(look)
            return unknown("stillness")
        self._past.append(look)
        past = list(self._past)
        now = past[-_AVERAGED:]
        marked = None if moment.grey is None else _mark(look, moment, person)
        moved = 0.0
        for share in _LOOKS:
            wanted = look.time_s - share * WINDOW_S
            at = min(range(len(past)), key=lambda k: abs(past[k].time_s - wanted))
            first = min(max(at - _AVERAGED // 2, 0), max(len(past) - _AVERAGED, 0))
            then = past[first : first + _AVERAGED]
            along = _along_mm(then, now, person.mask)
            if marked is None:
                across = _outline_mm(then, now, person.mask)
            else:
                across = _across_mm(past[at], look, marked, person.mask)
            moved = max(moved, float(np.hypot(across, along).max()))
        if moved > MOVING_MM:
            return Reading("stillness", moved, "mm", "bad", "Hold still.")
        if moved > STILL_MM:
            return Reading("stillness", moved, "mm", "fair", "Nearly still: hold on.")
        return Reading("stillness", moved, "mm", "good")


def _unlike(one: _Look, other: _Look) -> bool:
    """Whether two moments cannot be compared: another camera, or the clock went back."""
    shapes = [None if look.grey is None else look.grey.shape for look in (one, other)]
    return one.time_s <= other.time_s or shapes[0] != shapes[1] or one.depth_m.shape != other.depth_m.shape


def _look(moment: Moment, person: Person) -> _Look:
    inner = cv2.erode(person.mask.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    grey, focal = None, moment.camera.fx
    far_mm = 1000.0 * person.distance_m
    if moment.grey is not None:
        share = min(1.0, _WIDTH / moment.grey.shape[1])
        size = (round(moment.grey.shape[1] * share), round(moment.grey.shape[0] * share))
        grey = np.asarray(cv2.resize(moment.grey, size, interpolation=cv2.INTER_AREA), np.uint8)
        focal = moment.picture_focal * share
    scales = far_mm / focal, far_mm / moment.camera.fx
    return _Look(moment.time_s, grey, moment.depth_m, person.mask, np.asarray(inner), *scales)


def _mark(look: _Look, moment: Moment, person: Person) -> NDArray[np.float32]:
    """Corners on the body in the present picture, spread over its parts."""
    empty: NDArray[np.float32] = np.zeros((0, 1, 2), np.float32)
    on = moment.picture_mask(person.mask)
    if look.grey is None or on is None:
        return empty
    height, width = look.grey.shape
    mask = cv2.resize(on.astype(np.uint8), (width, height), interpolation=cv2.INTER_NEAREST)
    found = cv2.goodFeaturesToTrack(
        look.grey, maxCorners=_POINTS, qualityLevel=0.01, minDistance=5, mask=mask, blockSize=5
    )
    return empty if found is None else np.asarray(found, np.float32)


def _cells(rows: FloatArray, columns: FloatArray, person: BoolArray) -> NDArray[np.int64]:
    """Part of the body, from 0, of places given as shares (0..1) of the image."""
    ys, xs = np.flatnonzero(person.any(axis=1)), np.flatnonzero(person.any(axis=0))
    top, bottom = ys[0] / person.shape[0], (ys[-1] + 1) / person.shape[0]
    left, right = xs[0] / person.shape[1], (xs[-1] + 1) / person.shape[1]
    row = np.clip((rows - top) / max(bottom - top, 1e-6) * _ROWS, 0, _ROWS - 1).astype(np.int64)
    column = np.clip((columns - left) / max(right - left, 1e-6) * _COLUMNS, 0, _COLUMNS - 1)
    return np.asarray(row * _COLUMNS + column.astype(np.int64))


def _across_mm(then: _Look, now: _Look, marked: NDArray[np.float32], person: BoolArray) -> FloatArray:
    """Movement of every part in the picture."""
    moved = np.zeros(_ROWS * _COLUMNS)
    if len(marked) < _FEWEST or then.grey is None or now.grey is None:
        return moved
    to, found, _ = cv2.calcOpticalFlowPyrLK(now.grey, then.grey, marked, cast(Any, None), **_FLOW)
    back, again, _ = cv2.calcOpticalFlowPyrLK(then.grey, now.grey, to, cast(Any, None), **_FLOW)
    faithful = (found[:, 0] > 0) & (again[:, 0] > 0)
    faithful &= np.linalg.norm((back - marked)[:, 0], axis=1) < 0.3
    at, shift = marked[faithful, 0].astype(float), (to - marked)[faithful, 0].astype(float)
    height, width = now.grey.shape
    cell = _cells(at[:, 1] / height, at[:, 0] / width, person)
    for k in range(len(moved)):
        mine = shift[cell == k]
        if len(mine) >= _FEWEST:
            moved[k] = float(np.linalg.norm(np.median(mine, axis=0))) * now.mm_per_px
    return moved


def _outline_mm(then: list[_Look], now: list[_Look], person: BoolArray) -> FloatArray:
    """Movement of every part of the outline, where there is no picture.

    The step of Lucas and Kanade on the averaged outlines: every edge counts where it is, so that a hand that
    flickers in and out of view does not shift the arm beside it.
    """
    moved = np.zeros(_ROWS * _COLUMNS)
    one, other = (
        cv2.GaussianBlur(np.mean([look.person for look in looks], axis=0), (0, 0), _OUTLINE_PX)
        for looks in (then, now)
    )
    down, right = np.gradient(0.5 * (one + other))
    change = other - one
    around = cv2.dilate(person.astype(np.uint8), np.ones((7, 7), np.uint8)) > 0
    rows, columns = np.nonzero(around & (np.hypot(down, right) > _OUTLINE_SLOPE))
    cell = _cells(rows / person.shape[0], columns / person.shape[1], person)
    for k in range(len(moved)):
        at = rows[cell == k], columns[cell == k]
        if len(at[0]) < _FEWEST_DEPTH:
            continue
        slopes = np.stack([right[at], down[at]], axis=1)
        normal = slopes.T @ slopes
        normal += 0.02 * np.trace(normal) * np.eye(2)
        shift = -np.linalg.solve(normal, slopes.T @ change[at])
        left = change[at] + slopes @ shift
        # the smoothing has made neighbours alike: as many pixels as its window has area count as one
        alike = 2.0 * np.sqrt(np.pi) * _OUTLINE_PX
        noise = _NOISE_SIGMAS * alike * float(left.std()) * np.sqrt(np.trace(np.linalg.inv(normal)))
        moved[k] = np.sqrt(max(float(shift @ shift) - noise**2, 0.0)) * then[0].depth_mm_per_px
    return moved


def _along_mm(then: list[_Look], now: list[_Look], person: BoolArray) -> FloatArray:
    """Movement of every part towards the camera or away from it."""
    moved = np.zeros(_ROWS * _COLUMNS)
    both = np.logical_and.reduce([look.inner for look in (*then, *now)])
    rows, columns = np.nonzero(both)
    change = np.mean([look.depth_m[both] for look in now], axis=0)
    change -= np.mean([look.depth_m[both] for look in then], axis=0)
    cell = _cells(rows / person.shape[0], columns / person.shape[1], person)
    # the mean, not the median: the sensor's steps are coarser than what is to be seen, and noise dithers them
    ok = np.abs(change) < _JUMP_M
    cell, change = cell[ok], change[ok]
    count = np.bincount(cell, minlength=len(moved))
    total = np.bincount(cell, weights=change, minlength=len(moved))
    squares = np.bincount(cell, weights=change**2, minlength=len(moved))
    for k in np.flatnonzero(count >= _FEWEST_DEPTH):
        mean = float(total[k] / count[k])
        spread = float(np.sqrt(max(squares[k] / count[k] - mean**2, 0.0)))
        moved[k] = 1000.0 * _beyond_noise(mean, spread, int(count[k]))
    return moved


def _beyond_noise(mean: float, spread: float, count: int) -> float:
    """What of a mean of noisy values is more than the noise of the mean."""
    noise = _NOISE_SIGMAS * spread / np.sqrt(count)
    return float(np.sqrt(max(mean**2 - noise**2, 0.0)))


def burst_motion_mm(
    depth_frames: NDArray[np.uint16], unit_m: float, person: BoolArray, pixels_per_m: float
) -> float | None:
    """Movement from the beginning to the end of a burst; None if it is too short to tell.

    Parameters
    ----------
    depth_frames : ndarray (n, h, w) uint16
        Coarse: about `moment.COARSE_WIDTH` wide.
    unit_m : float
    person : ndarray (h, w) bool
        In the fused frames.
    pixels_per_m : float
        At the person.
    """
    if len(depth_frames) < 3 * _AVERAGED:
        return None
    depth = depth_frames * unit_m
    middle = float(np.median(depth[len(depth) // 2][person]))
    wide = cv2.dilate(person.astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
    kernel = np.ones((3, 3), np.uint8)
    looks = []
    for k, frame in enumerate(depth):
        on = np.asarray(wide & (frame > 0) & (np.abs(frame - middle) < _BODY_M))
        inner = np.asarray(cv2.erode(on.astype(np.uint8), kernel) > 0)
        looks.append(_Look(float(k), None, frame, on, inner, 0.0, 1000.0 / pixels_per_m))
    third = len(looks) // 3
    parts = [looks[:third], looks[third : 2 * third], looks[2 * third :]]
    moved = [
        np.hypot(_outline_mm(then, now, person), _along_mm(then, now, person)).max()
        for then, now in ((parts[0], parts[1]), (parts[1], parts[2]), (parts[0], parts[2]))
    ]
    return float(max(moved))
