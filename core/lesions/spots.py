"""All mole-like spots of a picture, on the skin."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from core.lesions.body_picture import BodyPicture, cut_body_picture
from core.lesions.lifting import lift_pixels
from core.lesions.likeness import likeness, look_around
from core.lesions.measure import Looks, darker_all_round, measure_blobs, skin_axes
from core.lesions.scale_space import find_blobs, strongest_only
from core.surface.scan import BodyScan

FloatArray = NDArray[np.float64]

_LEAST_CONFIDENCE = 0.02


@dataclass(frozen=True, eq=False)
class SkinSpots:
    """Mole-like spots of one capture, most mole-like first.

    Attributes
    ----------
    pixels : ndarray (n, 2)
        Picture pixels, sub-pixel.
    radius_px, radius_m : ndarray (n,)
        Half-darkness radius along the less foreshortened axis.
    contrast : ndarray (n,)
        Logarithm of the surroundings' grey value over the core's; positive is darker than the skin.
    color : ndarray (n, 3)
        Mean sRGB 0..255 of the core.
    confidence : ndarray (n,)
        Mole-likeness 0..1.
    points_m : ndarray (n, 3)
        On the skin, depth-camera frame; beside the rim of the measured skin on its tangent plane.
    normals : ndarray (n, 3)
        Unit, toward the camera.
    triangles : ndarray (n,) int32
    barycentric : ndarray (n, 3)
        The place on the scan's surface; beside the rim the nearest one.
    skin_color : ndarray (n, 3)
        Median sRGB 0..255 around the spot.
    """

    pixels: FloatArray
    radius_px: FloatArray
    radius_m: FloatArray
    contrast: FloatArray
    color: FloatArray
    confidence: FloatArray
    points_m: FloatArray
    normals: FloatArray
    triangles: NDArray[np.int32]
    barycentric: FloatArray
    skin_color: FloatArray

    def __len__(self) -> int:
        return len(self.pixels)

    def take(self, rows: NDArray[np.int64] | NDArray[np.bool_]) -> SkinSpots:
        """Only these rows, in this order."""
        return SkinSpots(*(getattr(self, name)[rows] for name in self.__dataclass_fields__))

    @classmethod
    def none(cls) -> SkinSpots:
        """No spots at all."""
        vectors, numbers = np.zeros((0, 3)), np.zeros(0)
        return cls(
            np.zeros((0, 2)), numbers, numbers, numbers, vectors, numbers, vectors, vectors,
            np.zeros(0, np.int32), vectors, vectors,
        )  # fmt: skip


def detect_spots(scan: BodyScan) -> SkinSpots:
    """Every mole-like spot of a scan's colour picture; empty without a picture."""
    picture = cut_body_picture(scan)
    if picture is None:
        return SkinSpots.none()
    camera, to_color = scan.capture.rig.picture_camera, scan.capture.rig.picture_from_depth
    blobs = find_blobs(picture)
    near = picture.vertex[picture.cells_at(blobs.places)]
    points, normals = scan.surface.vertices[near], scan.surface.normals[near]
    axes = _axes(scan, points, normals)
    guess = blobs.radius / np.sqrt(np.linalg.norm(axes[:, 1], axis=1))
    per_px = picture.shrink * to_color.apply(points)[:, 2] / camera.fx
    rows = np.flatnonzero(darker_all_round(picture, blobs.places, guess, axes))
    if len(rows) == 0:
        return SkinSpots.none()
    blobs, guess, axes, per_px, points = blobs.take(rows), guess[rows], axes[rows], per_px[rows], points[rows]
    looks = measure_blobs(picture, blobs.places, guess, axes)
    confidence = _judge(scan, picture, looks, blobs.noises, per_px, points)
    rows = _clearest(looks, confidence)
    if len(rows) == 0:
        return SkinSpots.none()
    # Once more from the better start, which makes the centres independent of where the blobs were found.
    looks = measure_blobs(picture, looks.places[rows], looks.radius[rows], axes[rows])
    confidence = _judge(scan, picture, looks, blobs.noises[rows], per_px[rows], points[rows])
    rows = _clearest(looks, confidence)
    pixels = picture.to_picture(looks.places[rows])
    lifted = lift_pixels(scan, pixels)
    radius_px = looks.radius[rows] * picture.shrink
    spots = SkinSpots(
        pixels=pixels,
        radius_px=radius_px,
        radius_m=radius_px * to_color.apply(lifted.points_m)[:, 2] / camera.fx,
        contrast=looks.contrast[rows],
        color=looks.color[rows],
        confidence=confidence[rows],
        points_m=lifted.points_m,
        normals=lifted.normals,
        triangles=lifted.triangles,
        barycentric=lifted.barycentric,
        skin_color=looks.skin_color[rows],
    )
    return spots.take(lifted.on_skin)


def _clearest(looks: Looks, confidence: FloatArray) -> NDArray[np.int64]:
    """Rows of the acceptable blobs, most mole-like first, each spot once."""
    rows = np.flatnonzero((confidence >= _LEAST_CONFIDENCE) & (looks.contrast > 0))
    rows = rows[np.argsort(-confidence[rows], kind="stable")]
    return rows[strongest_only(looks.places[rows], looks.radius[rows])]


def _judge(
    scan: BodyScan,
    picture: BodyPicture,
    looks: Looks,
    noises: FloatArray,
    m_per_px: FloatArray,
    points: FloatArray,
) -> FloatArray:
    around = look_around(scan, picture, looks.places, points)
    return likeness(looks, noises, looks.radius * m_per_px, around)


def _axes(scan: BodyScan, points: FloatArray, normals: FloatArray) -> FloatArray:
    """How unit circles on the skin at ``points`` (n, 3) look in the picture, (n, 2, 2)."""
    to_depth = scan.capture.rig.picture_from_depth.inverse()
    view = points - to_depth.translation
    view /= np.linalg.norm(view, axis=1, keepdims=True)
    right, down = to_depth.rotate(np.eye(3)[:2])
    return skin_axes(view, right, down, normals)
