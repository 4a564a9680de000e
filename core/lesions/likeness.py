"""How likely a measured blob is a mole."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from core.lesions.body_picture import BodyPicture
from core.lesions.measure import Looks
from core.surface.scan import BodyScan
from core.surface.skin_tone import to_lab

FloatArray = NDArray[np.float64]

_RINGS_M = (0.006, 0.010, 0.015)
_ANGLES = 12
_FACE_M = 0.13
_LEAST_CELLS = 4
_USUAL_RADIUS_M = 0.003


@dataclass(frozen=True, eq=False)
class Surroundings:
    """What lies 6 to 15 mm around blobs, row by row.

    Attributes
    ----------
    off_hue : ndarray (n,)
        Distance of the colour from the person's own skin in spreads of its hue; 0 where it cannot be judged.
    darkening : ndarray (n,)
        Lightness of the skin tone over the lightness around, minus 1, not below 0: shadow, hair or cloth.
    off_body : ndarray (n,)
        Share that is not on the measured body.
    face : ndarray (n,)
        1 in the middle of the head, 0 beyond its rim: eyes, nostrils and brows are dark and round.
    """

    off_hue: FloatArray
    darkening: FloatArray
    off_body: FloatArray
    face: FloatArray


def look_around(
    scan: BodyScan, picture: BodyPicture, places: FloatArray, points_m: FloatArray
) -> Surroundings:
    """Surroundings of crop pixels (n, 2) whose places on the skin are ``points_m`` (n, 3)."""
    rows, columns = picture.on_body.shape
    angle = 2.0 * np.pi * np.arange(_ANGLES) / _ANGLES
    toward = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    offsets = (np.array(_RINGS_M)[:, None, None] * toward).reshape(-1, 2) * picture.pixels_per_m
    r, c = picture.cells_at(places[:, None, :] + offsets)
    on_body = picture.on_body[r, c]
    off_hue, darkening = np.zeros(len(places)), np.zeros(len(places))
    tone = scan.skin_tone
    if tone is not None and len(places):
        small = cv2.resize(picture.rgb, (columns, rows), interpolation=cv2.INTER_AREA)
        lab = to_lab(small.reshape(-1, 3)).reshape(rows, columns, 3).astype(np.float32)
        around = np.where(on_body[..., None], lab[r, c], np.inf)
        count = on_body.sum(axis=1)
        middle = np.sort(around, axis=1)[np.arange(len(places)), np.maximum(count - 1, 0) // 2]
        middle = np.where((count >= _LEAST_CELLS)[:, None], middle, tone.center)
        off_hue = np.hypot(*((middle - tone.center) / tone.spread)[:, 1:].T)
        darkening = np.maximum(tone.center[0] / np.maximum(middle[:, 0], 1.0) - 1.0, 0.0)
    face = np.zeros(len(places))
    if scan.head_m is not None:
        away = np.linalg.norm(points_m - scan.head_m, axis=1)
        face = np.clip(2.0 - away / _FACE_M, 0.0, 1.0)
    return Surroundings(off_hue, darkening, 1.0 - on_body.mean(axis=1), face)


def evidence(looks: Looks, noises: FloatArray, radius_m: FloatArray, around: Surroundings) -> FloatArray:
    """The measurements (n, k) that `likeness` weighs, in the order of `_WEIGHTS`."""
    size = np.log(np.clip(radius_m, 0.0005, 0.02) / _USUAL_RADIUS_M)
    return np.stack(
        [
            np.ones_like(size),
            np.log(np.clip(looks.contrast, 0.02, 1.0)),
            np.log(np.clip(noises, 2.0, 30.0)),
            np.clip(looks.closed, 0.0, 1.0),
            np.clip(looks.tail, 0.0, 1.0),
            np.clip(looks.across, 0.0, 1.0),
            np.clip(looks.rough, 0.0, 0.5),
            np.clip(looks.fill, 0.3, 1.0),
            np.maximum(size, 0.0) ** 2,
            np.minimum(size, 0.0) ** 2,
            np.clip(around.off_hue - 2.0, 0.0, 6.0),
            np.clip(around.darkening, 0.0, 2.0),
            around.off_body,
            around.face,
        ],
        axis=1,
    )


# Learned by logistic regression on simulated pictures of light and dark skin, moles against everything else,
# freckles included; some with body hair, printed shirts or strong compression added. Contrast, closedness and
# fill were kept from falling below, and strange hue and darkening from rising above, what is plausible for
# real pictures, where hair, cloth and prints are more varied.
_WEIGHTS = np.array(
    [
        0.20,  # bias
        0.34,  # contrast
        0.77,  # noises
        2.00,  # closed
        -5.36,  # tail
        0.05,  # across
        -4.48,  # rough
        0.50,  # fill
        -0.20,  # larger than usual
        -4.75,  # smaller than usual
        -1.60,  # off_hue
        -0.50,  # darkening
        -1.77,  # off_body
        -1.34,  # face
    ]
)


def likeness(looks: Looks, noises: FloatArray, radius_m: FloatArray, around: Surroundings) -> FloatArray:
    """Probability (n,) of being a mole, as often right as it says on simulated pictures."""
    score = evidence(looks, noises, radius_m, around) @ _WEIGHTS
    return np.asarray(1.0 / (1.0 + np.exp(-np.clip(score, -30.0, 30.0))))
