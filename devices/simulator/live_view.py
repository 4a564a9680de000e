"""Frames of the viewfinder: a prepared scene, moved by sway and breath, with fresh noise. Milliseconds each.

Sway moves the picture by a few pixels at most, so every pixel fetches its content from where the coarse flow
field says (first order in the motion); depth changes by the flow's third part.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from devices.simulator.live_scene import LiveScene

_COLOR_NOISE = 2.0  # grey levels, about what the captures' pictures have
_NOISE_PICTURES = 6


class SceneView:
    """Draws frames of one scene.

    Parameters
    ----------
    scene : LiveScene
    seed : int
        Of the order of the noise.
    """

    def __init__(self, scene: LiveScene, seed: int) -> None:
        self._scene = scene
        self._rng = np.random.default_rng((0xF1, seed))
        self._depth_warp = _Warp(scene.depth_flow, *scene.fine_depth.shape[1:])
        height, width = scene.rgb.shape[:2]
        self._color_warp = _Warp(scene.color_flow, height, width)
        noise = self._rng.standard_normal((_NOISE_PICTURES, height, width, 3), np.float32)
        self._noise = np.clip(np.rint(_COLOR_NOISE * noise), -9, 9).astype(np.int8)

    @property
    def depth_unit_m(self) -> float:
        """Metres per raw unit."""
        return self._scene.depth_unit_m

    def depth(self, motion: NDArray[np.float64]) -> NDArray[np.uint16]:
        """Raw depth (h, w) with the patient moved by these amounts (3,) of the scene's modes."""
        scene = self._scene
        flow = np.tensordot(motion.astype(np.float32), scene.depth_flow, 1)
        fine = scene.fine_depth[self._rng.integers(len(scene.fine_depth))].copy()
        self._depth_warp.move(fine, flow, cv2.INTER_NEAREST)
        return np.asarray(np.take(scene.raw_of_fine, fine.view(np.uint16)))

    def rgb(self, motion: NDArray[np.float64], gain: NDArray[np.uint8] | None = None) -> NDArray[np.uint8]:
        """Colour picture (h, w, 3) of the same moment; ``gain`` (256,) is the camera's exposure."""
        flow = np.tensordot(motion.astype(np.float32), self._scene.color_flow, 1)
        moved = self._scene.rgb.copy()
        self._color_warp.move(moved, flow, cv2.INTER_LINEAR)
        if gain is not None:
            moved = cv2.LUT(moved, gain)
        noise = self._noise[self._rng.integers(len(self._noise))]
        return np.asarray(cv2.add(moved, noise, dtype=cv2.CV_8U), np.uint8)


class _Warp:
    """Moves the part of a picture in which a flow field is not zero."""

    def __init__(self, modes: NDArray[np.float32], height: int, width: int) -> None:
        rows, columns = modes.shape[-2:]
        busy = (np.abs(modes).max(axis=(0, 1)) > 1e-3 * np.abs(modes).max()).astype(np.uint8)
        x, y, w, h = cv2.boundingRect(busy)
        self._cells = (slice(y, y + h), slice(x, x + w))
        u0, v0 = x * width // columns, y * height // rows
        u1, v1 = (x + w) * width // columns, (y + h) * height // rows
        self._pixels = (slice(v0, v1), slice(u0, u1))
        self._size = (u1 - u0, v1 - v0)
        u, v = np.meshgrid(np.arange(u0, u1, dtype=np.float32), np.arange(v0, v1, dtype=np.float32))
        self._u, self._v = u, v

    def move(self, picture: NDArray[np.generic], flow: NDArray[np.float32], how: int) -> None:
        """Move a picture in place; a third part of the flow is added to its values."""
        part = flow[(slice(None), *self._cells)]
        u = cv2.subtract(self._u, cv2.resize(part[0], self._size, interpolation=cv2.INTER_LINEAR))
        v = cv2.subtract(self._v, cv2.resize(part[1], self._size, interpolation=cv2.INTER_LINEAR))
        moved = cv2.remap(picture, u, v, how, borderMode=cv2.BORDER_REPLICATE)
        if len(part) > 2:
            change = np.rint(part[2]).astype(np.int16)
            moved = cv2.add(moved, cv2.resize(change, self._size, interpolation=cv2.INTER_NEAREST))
        picture[self._pixels] = moved
