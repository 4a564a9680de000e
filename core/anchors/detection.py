"""Landmarks in pixels: from the colour picture, from the shaded relief of the depth, or from both."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from core.anchors.names import LANDMARK_NAMES, OPPOSITE_LANDMARKS
from core.anchors.relief import LAMPS, shade_depth
from core.anchors.skeleton import VISIBLE, PoseLandmarks, SkeletonTracker
from core.surface import BodyScan

FloatArray = NDArray[np.float64]

CROP_SIZE: Final = 640
"""Side of the square picture given to the tracker, pixels."""

CROP_SCALES: Final = (1.24, 1.55)
"""Sides of the crop relative to the longer side of the body's box."""

_DARK_LEVEL: Final = 40.0
_FLAT_LEVEL: Final = 9.0
_LEFT_SHOULDER: Final = LANDMARK_NAMES.index("left_shoulder")
_RIGHT_SHOULDER: Final = LANDMARK_NAMES.index("right_shoulder")
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
    color = _detect(picture, _square(pixels, CROP_SCALES[0]), tracker)
    doubtful = bool(fault) or color is None or _clarity(color) < VISIBLE
    relief = detect_in_relief(scan, tracker, thorough=doubtful)
    if color is not None and (not doubtful or relief is None or _clarity(color) >= _clarity(relief)):
        said = (f"The colour picture is {fault}: joints may be inexact.",) if fault else ()
        return Detection(color, "color", relief, said)
    if relief is None:
        return None
    why = f"The colour picture is {fault}" if fault else "The person is not clear in the colour picture"
    return Detection(relief, "relief", color, (f"{why}: the joints come from the depth image.",))


def detect_in_relief(scan: BodyScan, tracker: SkeletonTracker, *, thorough: bool) -> PoseLandmarks | None:
    """Landmarks in pixels of the depth image, from the shaded relief.

    Parameters
    ----------
    scan : BodyScan
    tracker : SkeletonTracker
    thorough : bool
        True: several lamps, crops and mirror images, fused by `consensus`. False: one look.
    """
    depth, mask, camera = scan.fused.depth_m, scan.mask.mask, scan.surface.camera
    pixels = scan.surface.pixels.astype(np.float64)
    looks: list[PoseLandmarks | None] = []
    for lamp in LAMPS if thorough else LAMPS[:1]:
        image = shade_depth(depth, mask, camera, lamp)
        for scale in CROP_SCALES if thorough else CROP_SCALES[:1]:
            square = _square(pixels, scale)
            looks.append(_detect(image, square, tracker))
            if thorough:
                looks.append(_detect(image, square, tracker, mirror=True))
    return consensus(looks)


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


def consensus(looks: Sequence[PoseLandmarks | None]) -> PoseLandmarks | None:
    """Several looks at the same pixels as one: the median place, and less visibility where they differ.

    Looks that disagree about left and right are settled by the majority.
    """
    seen = [look for look in looks if look is not None]
    if not seen:
        return None
    turned = [look.pixels[_LEFT_SHOULDER, 0] > look.pixels[_RIGHT_SHOULDER, 0] for look in seen]
    majority = 2 * sum(turned) >= len(seen)
    seen = [look for look, side in zip(seen, turned, strict=True) if side == majority]
    places = np.stack([look.pixels for look in seen])
    visibility = np.stack([look.visibility for look in seen])
    middle = np.median(places, axis=0)
    size = float(np.ptp(middle, axis=0).max())
    near = np.linalg.norm(places - middle, axis=-1) < 0.06 * size
    # among the looks near the median, the confident ones count more
    weight = np.where(near, visibility + 1e-3, 0.0)
    total = weight.sum(0)
    mean = np.einsum("kl,kld->ld", weight, places) / np.maximum(total, 1e-9)[:, None]
    place = np.where((total > 0)[:, None], mean, middle)
    return PoseLandmarks(place, np.median(visibility, axis=0) * near.mean(0))


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
    x, y, side = square
    scale = CROP_SIZE / side
    middle = (CROP_SIZE - 1) / 2
    if scale < 1:
        # area averaging first, or fine texture turns into noise
        blur = 0.45 / scale
        image = np.asarray(cv2.GaussianBlur(image, (0, 0), blur), dtype=np.uint8) if blur > 0.6 else image
    sign = -1.0 if mirror else 1.0
    matrix = np.array([[sign * scale, 0.0, middle - sign * scale * x], [0.0, scale, middle - scale * y]])
    crop = cv2.warpAffine(
        image, matrix, (CROP_SIZE, CROP_SIZE), flags=cv2.INTER_LINEAR, borderValue=(118.0, 118.0, 118.0)
    )
    found = tracker.detect(np.asarray(crop, dtype=np.uint8))
    if found is None:
        return None
    pixels = np.stack(
        [(found.pixels[:, 0] - matrix[0, 2]) / matrix[0, 0], (found.pixels[:, 1] - matrix[1, 2]) / scale],
        axis=1,
    )
    if not mirror:
        return PoseLandmarks(pixels, found.visibility)
    return PoseLandmarks(pixels[_OPPOSITE], found.visibility[_OPPOSITE])
