"""Does a spot lie on bare skin? A cautious judgement from colour, for one warning and one refusal.

Limits, on purpose: it compares with the person's own skin, found by a loose colour range and the majority
inside it; without enough such pixels it says nothing. Skin-coloured clothing passes. Hair is only claimed on
the upper head and only when it is much darker than the skin; on very dark skin it is never claimed, and grey,
fair and body hair pass. Depth-only recordings are never judged.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from core.surface.scan import BodyScan
from core.surface.skin_tone import to_lab

FloatArray = NDArray[np.float64]
Verdict = Literal["skin", "clothing", "hair", "unknown"]
# A ring around the spot, so that the lesion itself is not judged.
_RING_M = (0.008, 0.020)
_RING_SAMPLES = 60
_HAIR_REACH_M = 0.17
_HAIR_DARKNESS = 0.55
_CHROMA_SPREAD = 4.0


def judge_skin(scan: BodyScan, position_m: FloatArray, head_m: FloatArray | None = None) -> Verdict:
    """Whether the skin around a position looks bare, dressed or covered with hair.

    Parameters
    ----------
    position_m : ndarray (3,)
        On the surface, depth-camera frame.
    head_m : ndarray (3,), optional
        Centre of the head; from recorded joints or the outline without it.
    """
    tone = scan.skin_tone
    patch = _ring(scan, position_m)
    if tone is None or patch is None:
        return "unknown"
    lab = np.median(patch, axis=0)
    away = (lab - tone.center) / tone.spread
    dark = lab[0] < _HAIR_DARKNESS * tone.center[0]
    if dark and tone.center[0] > 35:
        head = head_m if head_m is not None else scan.head_m
        if head is not None and np.linalg.norm(position_m - head) < _HAIR_REACH_M:
            return "hair"
    off = float(np.hypot(away[1], away[2]))
    return "clothing" if dark or off > _CHROMA_SPREAD else "skin"


def _ring(scan: BodyScan, position_m: FloatArray) -> FloatArray | None:
    """Lab colours (k, 3) of the picture in a ring around a position, on the body only."""
    color = scan.capture.color
    if color is None:
        return None
    rig = scan.capture.rig
    center = rig.project_to_picture(position_m)[0]
    z = float(rig.picture_from_depth.apply(position_m)[2])
    if not np.isfinite(center).all() or z <= 0:
        return None
    inner, outer = (r * rig.picture_camera.fx / z for r in _RING_M)
    outer = max(outer, inner + 2.0)
    u0, v0 = (max(0, int(c - outer)) for c in center)
    window = color[v0 : int(center[1] + outer) + 2, u0 : int(center[0] + outer) + 2]
    v, u = np.mgrid[: window.shape[0], : window.shape[1]]
    distance = np.hypot(u + u0 - center[0], v + v0 - center[1])
    ring = (distance >= inner) & (distance <= outer)
    if ring.sum() < 4:
        return None
    rows, columns = np.nonzero(ring)
    step = max(1, len(rows) // _RING_SAMPLES)
    rows, columns = rows[::step], columns[::step]
    rays = rig.picture_rays(np.stack([columns + u0, rows + v0], axis=1))
    on_body = scan.surface.raycast(*rays).hit
    if on_body.sum() < 4:
        return None
    return to_lab(window[rows, columns][on_body])
