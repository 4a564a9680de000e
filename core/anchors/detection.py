"""Landmarks in pixels: from the colour picture, from the shaded relief of the depth, or from both."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Final, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from core.anchors.names import LANDMARK_NAMES, OPPOSITE_LANDMARKS
from core.anchors.relief import LAMPS, shade_depth, shade_depths
from core.anchors.skeleton import VISIBLE, PoseLandmarks, SkeletonTracker
from core.surface import BodyScan, fuse_depth

FloatArray = NDArray[np.float64]

CROP_SIZE: Final = 640
"""Side of the square picture given to the tracker, pixels."""

CROP_SCALES: Final = (1.24, 1.55)
"""Sides of the crop relative to the longer side of the body's box."""

CLOSE_UP: Final = 4.5
"""Side of a close-up of head and shoulders, in widths of the shoulders."""

_LEAST_FRAMES: Final = 3
_DARK_LEVEL: Final = 40.0
_FLAT_LEVEL: Final = 9.0
_LEFT_SHOULDER: Final = LANDMARK_NAMES.index("left_shoulder")
_RIGHT_SHOULDER: Final = LANDMARK_NAMES.index("right_shoulder")
_UPPER_BODY: Final = np.arange(len(LANDMARK_NAMES)) < LANDMARK_NAMES.index("left_hip")
_OPPOSITE: Final = np.array(OPPOSITE_LANDMARKS)


@dataclass(frozen=True, eq=False)
class Detection:
    """Landmarks of one scan.

    Attributes
    ----------
    landmarks : PoseLandmarks
        Pixels of the colour picture for source "color", of the depth image for source "relief".
    source : {"color", "relief"}
    second : PoseLandmarks or None
        What the other source saw, in its own pixels.
    warnings : tuple of str
    """

    landmarks: PoseLandmarks
    source: Literal["color", "relief"]
    second: PoseLandmarks | None = None
    warnings: tuple[str, ...] = ()


def detect_pose(scan: BodyScan, tracker: SkeletonTracker) -> Detection | None:
    """Find the landmarks of the scanned person.

    Colour is preferred. Without it, or where it is dark, flat or shows nobody clearly, the relief answers.

    Returns
    -------
    Detection or None
        None if neither shows a person.
    """
    picture = scan.capture.color
    if picture is None:
        relief = detect_in_relief(scan, tracker, thorough=True)
        return None if relief is None else Detection(relief, "relief")
    pixels = scan.vertex_picture_pixels
    fault = picture_fault(picture, pixels)
    color = _look_twice(picture, pixels, tracker)
    doubtful = bool(fault) or color is None or _clarity(color) < VISIBLE
    relief = detect_in_relief(scan, tracker, thorough=doubtful)
    if color is not None and (not doubtful or relief is None or _clarity(color) >= _clarity(relief)):
        said = (f"The colour picture is {fault}: joints may be inexact.",) if fault else ()
        return Detection(color, "color", relief, said)
    if relief is None:
        return None
    why = f"The colour picture is {fault}" if fault else "The person is not clear in the colour picture"
    return Detection(relief, "relief", color, (f"{why}: the joints come from the depth image.",))


def _look_twice(
    picture: NDArray[np.uint8], pixels: FloatArray, tracker: SkeletonTracker
) -> PoseLandmarks | None:
    """The colour picture and its mirror image as one look: what the tracker does to one side only, goes.

    Measured on 22 rendered pairs of visits, anchors stray 27.7 instead of 29.7 mm on the skin from visit to
    visit (31.7 instead of 36.3 between different stances); further looks bring nothing. The difference of the
    two says how sure a landmark is.
    """
    square = _square(pixels, CROP_SCALES[0])
    crop = _crop(picture, square)
    first = _look(crop, square, tracker, mirror=False)
    if first is None:
        return None
    second = _look(crop, square, tracker, mirror=True)
    return first if second is None else consensus([first, second], _faces(first))


def detect_in_relief(scan: BodyScan, tracker: SkeletonTracker, *, thorough: bool) -> PoseLandmarks | None:
    """Landmarks in pixels of the depth image, from the shaded relief.

    Close-ups of head and shoulders decide which side is left and help with the arms: in a relief of the whole
    body the face is a few pixels, and the tracker then takes fronts for backs.

    Parameters
    ----------
    scan : BodyScan
    tracker : SkeletonTracker
    thorough : bool
        True: all looks (lamps, crops, mirror images, each lamp on its own share of the frames) fused by
        `consensus`, against the rare look that misses a limb. False: the first look whose sides agree with
        the close-ups.
    """
    images = _reliefs(scan, apart=thorough)
    pixels = scan.surface.pixels.astype(np.float64)
    squares = [_square(pixels, scale) for scale in CROP_SCALES]
    looks: list[PoseLandmarks] = []
    close: list[PoseLandmarks] = []
    facing: bool | None = None
    for k, (lamp, mirror) in enumerate(product(range(len(images)), (False, True))):
        look = _detect(images[lamp], squares[(lamp + mirror) % len(squares)], tracker, mirror=mirror)
        if look is None:
            continue
        looks.append(look)
        if not close:
            close = _close_ups(images, look, tracker)
            facing = 2 * sum(map(_faces, close)) > len(close) if close else None
        if not thorough and (facing is None or _faces(look) == facing or k == 3):
            break
    return consensus([*looks, *close], facing)


def _reliefs(scan: BodyScan, *, apart: bool) -> list[NDArray[np.uint8]]:
    """The relief under every lamp; ``apart``: each lamp on every third frame of the burst.

    The shares differ by noise and by how the patient sways, so the consensus of the looks also smooths over
    time, and their spread says how much there was to smooth. Measured on 15 rendered captures: a median error
    of 28.7 instead of 30.1 mm, at no more looks.
    """
    camera, frames = scan.surface.camera, scan.capture.depth_frames
    if not apart or len(frames) < _LEAST_FRAMES * len(LAMPS):
        return shade_depths(scan.fused.depth_m, scan.mask.mask, camera)
    return [
        shade_depth(
            fuse_depth(frames[k :: len(LAMPS)], scan.capture.depth_unit_m).depth_m,
            scan.mask.mask,
            camera,
            lamp,
        )
        for k, lamp in enumerate(LAMPS)
    ]


def _close_ups(
    images: Sequence[NDArray[np.uint8]], look: PoseLandmarks, tracker: SkeletonTracker
) -> list[PoseLandmarks]:
    """Looks at head, shoulders and arms under every lamp; what lies outside them is not visible."""
    shoulders = look.pixels[[_LEFT_SHOULDER, _RIGHT_SHOULDER]]
    middle = shoulders.mean(0)
    width = float(np.linalg.norm(shoulders[0] - shoulders[1]))
    if width < 8.0:
        return []
    square = (float(middle[0]), float(middle[1]) + 0.15 * width, CLOSE_UP * width)
    found = [_detect(image, square, tracker, mirror=k % 2 == 1) for k, image in enumerate(images)]
    reach = square[2] / 2
    return [
        PoseLandmarks(
            at.pixels,
            np.where((np.abs(at.pixels - square[:2]) < reach).all(1) & _UPPER_BODY, at.visibility, 0.0),
        )
        for at in found
        if at is not None
    ]


def _faces(landmarks: PoseLandmarks) -> bool:
    """Whether the person faces the camera: the left shoulder is on the right of the picture."""
    return bool(landmarks.pixels[_LEFT_SHOULDER, 0] > landmarks.pixels[_RIGHT_SHOULDER, 0])


def picture_fault(picture: NDArray[np.uint8], pixels: FloatArray) -> str:
    """What is wrong with a colour picture where the body is: "too dark", "without contrast" or nothing ("").

    Parameters
    ----------
    picture : ndarray (h, w, 3) uint8
    pixels : ndarray (n, 2)
        Picture pixels on the body.
    """
    height, width = picture.shape[:2]
    finite = pixels[np.isfinite(pixels).all(1)]
    at = np.rint(finite[:: max(len(finite) // 4000, 1)]).astype(int)
    inside = (at[:, 0] >= 0) & (at[:, 0] < width) & (at[:, 1] >= 0) & (at[:, 1] < height)
    at = at[inside]
    if not len(at):
        return "not aimed at the body"
    luminance = picture[at[:, 1], at[:, 0]].astype(np.float64) @ (0.299, 0.587, 0.114)
    if np.percentile(luminance, 75) < _DARK_LEVEL:
        return "too dark"
    if np.subtract(*np.percentile(luminance, [95, 5])) < _FLAT_LEVEL:
        return "without contrast"
    return ""


def consensus(looks: Sequence[PoseLandmarks], facing: bool | None = None) -> PoseLandmarks | None:
    """Several looks at the same pixels as one: the mean near the median; less visible where they differ.

    Parameters
    ----------
    looks : sequence of PoseLandmarks
    facing : bool or None
        Only looks at a person facing the camera (True) or turned away (False) count, if there are any;
        None: the majority decides.
    """
    if not looks:
        return None
    sides = [_faces(look) for look in looks]
    wanted = facing if facing in sides else 2 * sum(sides) >= len(looks)
    seen = [look for look, side in zip(looks, sides, strict=True) if side == wanted]
    places = np.stack([look.pixels for look in seen])
    visibility = np.stack([look.visibility for look in seen])
    # a look that does not see a landmark has no say in its place while others see it
    heard = visibility >= 0.5 * visibility.max(0)
    middle = np.nanmedian(np.where(heard[..., None], places, np.nan), axis=0)
    size = float(np.ptp(middle, axis=0).max())
    near = heard & (np.linalg.norm(places - middle, axis=-1) < 0.06 * size)
    # among the looks near the median, the confident ones count more
    weight = np.where(near, visibility + 1e-3, 0.0)
    total = weight.sum(0)
    mean = np.einsum("kl,kld->ld", weight, places) / np.maximum(total, 1e-9)[:, None]
    place = np.where((total > 0)[:, None], mean, middle)
    trust = np.nanmedian(np.where(heard, visibility, np.nan), axis=0) * near.sum(0) / heard.sum(0)
    # of k looks the mean takes one degree of freedom; a landmark that only one look hears has no spread
    square = np.where(near, ((places - place) ** 2).sum(-1) / 2.0, 0.0).sum(0)
    looks_near = near.sum(0)
    spread = np.sqrt(np.divide(square, looks_near - 1, out=np.zeros(len(place)), where=looks_near > 1))
    return PoseLandmarks(place, trust, spread)


def _clarity(landmarks: PoseLandmarks) -> float:
    """Median visibility of the arms, the trunk and the head: feet and hands are often out of the picture."""
    return float(np.median(landmarks.visibility[[0, 7, 8, 11, 12, 13, 14, 23, 24]]))


def _square(pixels: FloatArray, scale: float) -> tuple[float, float, float]:
    """Centre and side of the square around the body's pixels."""
    finite = pixels[np.isfinite(pixels).all(1)]
    low, high = finite.min(0), finite.max(0)
    middle = (low + high) / 2
    return float(middle[0]), float(middle[1]), float(scale * max((high - low).max(), 8.0))


def _detect(
    image: NDArray[np.uint8],
    square: tuple[float, float, float],
    tracker: SkeletonTracker,
    *,
    mirror: bool = False,
) -> PoseLandmarks | None:
    """Run the tracker on a square of an image; the answer is in the image's pixels."""
    return _look(_crop(image, square), square, tracker, mirror=mirror)


def _crop(image: NDArray[np.uint8], square: tuple[float, float, float]) -> NDArray[np.uint8]:
    """The square of an image, `CROP_SIZE` pixels wide."""
    x, y, side = square
    scale = CROP_SIZE / side
    middle = (CROP_SIZE - 1) / 2
    if scale < 1:
        # area averaging first, or fine texture turns into noise
        blur = 0.45 / scale
        image = np.asarray(cv2.GaussianBlur(image, (0, 0), blur), dtype=np.uint8) if blur > 0.6 else image
    matrix = np.array([[scale, 0.0, middle - scale * x], [0.0, scale, middle - scale * y]])
    crop = cv2.warpAffine(
        image, matrix, (CROP_SIZE, CROP_SIZE), flags=cv2.INTER_LINEAR, borderValue=(118.0, 118.0, 118.0)
    )
    return np.asarray(crop, dtype=np.uint8)


def _look(
    crop: NDArray[np.uint8],
    square: tuple[float, float, float],
    tracker: SkeletonTracker,
    *,
    mirror: bool,
) -> PoseLandmarks | None:
    """Run the tracker on a crop or its mirror image; the answer is in the pixels of the whole image."""
    found = tracker.detect(np.ascontiguousarray(crop[:, ::-1]) if mirror else crop)
    if found is None:
        return None
    x, y, side = square
    at = found.pixels.copy()
    visibility = found.visibility
    if mirror:
        at[:, 0] = CROP_SIZE - 1 - at[:, 0]
        at, visibility = at[_OPPOSITE], visibility[_OPPOSITE]
    return PoseLandmarks((at - (CROP_SIZE - 1) / 2) * (side / CROP_SIZE) + np.array([x, y]), visibility)
