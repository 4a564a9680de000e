"""The surface of a hand held before the camera: cut from a depth image around a place on it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from core.capture.camera import PinholeCamera
from core.errors import WorkError
from core.hand.segmentation import REACH_M, HandPart, part_of_hand
from core.surface.body_surface import BodySurface

__all__ = ["REACH_M", "HandSurface", "cut_hand", "mesh_part"]

FloatArray = NDArray[np.float64]

SPACING_M = 0.0026
"""Between vertices, if nothing else is asked for: some 1500 to 2500 vertices on a hand."""

WRIST_M = 0.06
"""From the middle of the anchors to behind the wrist of a large hand."""

JUMP_M = 0.012
"""A triangle's corners differ by less in depth, at 2 mm between them; in proportion otherwise."""

_SMOOTH_M = 0.0025
_SMOOTH_PX = (1.2, 2.8)
_GATE_M = 0.012
_SMALLEST_PART = 100


@dataclass(frozen=True, eq=False)
class HandSurface:
    """The skin of hand and forearm within reach of the marker, in the depth camera's frame.

    Attributes
    ----------
    surface : BodySurface
        Its camera is the depth camera cropped by `corner_px` and thinned by `step_px`.
    corner_px : tuple of int
        Upper left pixel (u, v) of the crop in the depth image.
    step_px : int
        Every so many pixels became a vertex.
    touching : str or None
        A sentence if the hand lies against something large, which then is part of the surface.
    """

    surface: BodySurface
    corner_px: tuple[int, int]
    step_px: int
    touching: str | None = None


def cut_hand(
    depth_m: FloatArray,
    camera: PinholeCamera,
    seed_m: FloatArray,
    *,
    step_px: int | None = None,
    toward: FloatArray | None = None,
) -> HandSurface:
    """Skin connected to a place on the hand.

    Parameters
    ----------
    depth_m : ndarray (h, w)
        Metres, 0 for no measurement.
    camera : PinholeCamera
    seed_m : ndarray (k, 3)
        Places on the back of the hand, for example the marker's corners; depth frame. NaN rows do not count.
    step_px : int, optional
        Pixels between vertices; by default what comes nearest to `SPACING_M`.
    toward : ndarray (3,), optional
        Direction from the seeds to the fingers. Of the forearm, only `WRIST_M` is then kept: no way from an
        anchor to a point leads over it, and it has a third of the vertices.

    Raises
    ------
    WorkError
        If there is no surface at these places.
    """
    part = part_of_hand(depth_m, camera, seed_m)
    return mesh_part(part if toward is None else _without_forearm(part, toward), step_px)


def _without_forearm(part: HandPart, toward: FloatArray) -> HandPart:
    """The part without what lies farther behind its middle than the wrist."""
    direction = toward / np.linalg.norm(toward)
    along = part.depth_m * (part.camera.pixel_rays @ direction) - float(part.centre_m @ direction)
    return replace(part, mask=part.mask & (along > -WRIST_M))


def mesh_part(part: HandPart, step_px: int | None = None) -> HandSurface:
    """Smooth the pixels of a hand where there will be vertices, and join these to triangles."""
    from core.hand.surface_kernels import smooth_grid

    camera = part.camera
    pixel_m = float(part.centre_m[2]) / camera.fx
    step = step_px if step_px is not None else max(1, round(SPACING_M / pixel_m))
    sigma = float(np.clip(_SMOOTH_M / pixel_m, *_SMOOTH_PX))
    depth = smooth_grid(
        part.depth_m,
        part.median_m,
        part.mask,
        step,
        _gaussian(sigma),
        _GATE_M,
    )
    thinned = replace(
        camera,
        width=depth.shape[1],
        height=depth.shape[0],
        fx=camera.fx / step,
        fy=camera.fy / step,
        cx=camera.cx / step,
        cy=camera.cy / step,
    )
    jump = JUMP_M * max(1.0, step * pixel_m / 0.002)
    try:
        surface = BodySurface.from_depth(depth, thinned, jump_m=jump, smallest_part=_SMALLEST_PART)
    except WorkError as error:
        raise WorkError(
            "Too little of the hand is measured.", "Hold the hand 0.5 to 1 m from the camera, not edge on."
        ) from error
    return HandSurface(surface, part.corner_px, step, part.touching)


def _gaussian(sigma_px: float) -> NDArray[np.float32]:
    radius = max(1, int(np.ceil(2.2 * sigma_px)))
    steps = np.arange(-radius, radius + 1) ** 2
    return np.exp(-(steps[:, None] + steps[None]) / (2.0 * sigma_px**2)).astype(np.float32)
