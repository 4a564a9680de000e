"""What the 3D view of a hand draws, prepared away from the window: coloured skin, points, bones."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.workflows.hand_rows import HandShot
from core.hand.answer import HandAnswer
from core.hand.surface import HandSurface

FloatArray = NDArray[np.float64]

SKIN_RGB = (214, 196, 184)
MOST_TRIANGLES = 24_000
"""More would not follow the mouse on software OpenGL."""

LIFT_M = 0.003
"""Points are drawn a little before the skin, so that its noise does not hide them."""


@dataclass(frozen=True, eq=False)
class HandMesh:
    """A hand in 3D, depth-camera frame.

    Attributes
    ----------
    vertices : ndarray (n, 3) float32
    triangles : ndarray (m, 3) int64
    faces : ndarray (4 m,) int64
        The same as VTK takes them.
    normals : ndarray (n, 3) float32
        Toward the camera.
    colors : ndarray (n, 3) uint8
    points_m : ndarray (15, 3)
        NaN for those not told.
    confidence : ndarray (15,)
    anchors_m : ndarray (a, 3)
    """

    vertices: NDArray[np.float32]
    triangles: NDArray[np.int64]
    faces: NDArray[np.int64]
    normals: NDArray[np.float32]
    colors: NDArray[np.uint8]
    points_m: FloatArray
    confidence: FloatArray
    anchors_m: FloatArray


def hand_mesh(
    shot: HandShot, surface: HandSurface | None, answer: HandAnswer | None, anchors_m: FloatArray
) -> HandMesh:
    """The mesh of a frame; without a surface only its points."""
    points = np.full((15, 3), np.nan) if answer is None else answer.points_m
    confidence = np.zeros(15) if answer is None else answer.confidence
    if surface is None:
        vertices, triangles = np.zeros((0, 3)), np.zeros((0, 3), np.int64)
    else:
        vertices, triangles = _thinned(surface)
    normals = _normals(vertices, triangles)
    lifted = points * (1.0 - LIFT_M / np.maximum(np.linalg.norm(points, axis=1, keepdims=True), 0.1))
    return HandMesh(
        vertices.astype(np.float32),
        triangles,
        np.column_stack([np.full(len(triangles), 3, np.int64), triangles]).ravel(),
        normals.astype(np.float32),
        _colors(shot, vertices),
        lifted,
        confidence,
        anchors_m,
    )


def _thinned(surface: HandSurface) -> tuple[FloatArray, NDArray[np.int64]]:
    """Vertices and triangles, of every second row and column where there are too many."""
    skin = surface.surface
    vertices, triangles = skin.vertices, np.asarray(skin.triangles, np.int64)
    if len(triangles) <= MOST_TRIANGLES:
        return vertices, triangles
    pixels = skin.pixels
    step = int(np.ceil(np.sqrt(len(triangles) / MOST_TRIANGLES)))
    kept = np.flatnonzero((pixels % step == 0).all(axis=1))
    grid = np.full((pixels[:, 1].max() // step + 2, pixels[:, 0].max() // step + 2), -1, np.int64)
    grid[pixels[kept, 1] // step, pixels[kept, 0] // step] = np.arange(len(kept))
    a, b, c, d = grid[:-1, :-1], grid[:-1, 1:], grid[1:, :-1], grid[1:, 1:]
    faces = np.concatenate(
        [
            np.stack([a, c, b], axis=-1).reshape(-1, 3),
            np.stack([b, c, d], axis=-1).reshape(-1, 3),
        ]
    )
    faces = faces[(faces >= 0).all(axis=1)]
    coarse = vertices[kept]
    depth = coarse[faces, 2]
    return coarse, faces[depth.max(axis=1) - depth.min(axis=1) < 0.012 * step]


def _normals(vertices: FloatArray, triangles: NDArray[np.int64]) -> FloatArray:
    if not len(triangles):
        return np.zeros((len(vertices), 3))
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    face = np.cross(b - a, c - a)
    normals = np.stack(
        [
            sum(np.bincount(triangles[:, k], face[:, axis], len(vertices)) for k in range(3))
            for axis in range(3)
        ],
        axis=1,
    )
    away = np.einsum("ij,ij->i", normals, vertices) > 0
    normals[away] *= -1.0
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.asarray(normals / np.maximum(length, 1e-12))


def _colors(shot: HandShot, vertices: FloatArray) -> NDArray[np.uint8]:
    if shot.rgb is None or not len(vertices):
        return np.tile(np.array(SKIN_RGB, np.uint8), (len(vertices), 1))
    pixels = shot.rig.project_to_picture(vertices)
    height, width = shot.rgb.shape[:2]
    u = np.clip(np.rint(np.nan_to_num(pixels[:, 0])), 0, width - 1).astype(int)
    v = np.clip(np.rint(np.nan_to_num(pixels[:, 1])), 0, height - 1).astype(int)
    return np.ascontiguousarray(shot.rgb[v, u])
