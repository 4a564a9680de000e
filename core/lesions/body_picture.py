"""The part of the colour picture that shows the body, ready to be searched for spots."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from core.surface.scan import BodyScan

FloatArray = NDArray[np.float64]
Image = NDArray[np.float32]
BoolImage = NDArray[np.bool_]

# Finer pictures are shrunk: a mole of 1 mm radius then still covers about two pixels.
_PIXELS_PER_M = 950.0
_MARGIN_M = 0.02
# Grey of the weights below plus this: keeps the noise of deep shadow from looking like contrast.
_DARK_OFFSET = 4.0
# Melanin absorbs blue and green; equal shares would have the least noise, and blue is the noisiest channel.
_GREY_WEIGHTS = np.array([[0.25, 0.50, 0.25]], np.float32)
_LOGARITHM = np.log(np.arange(256, dtype=np.float32) + np.float32(_DARK_OFFSET))


@dataclass(frozen=True, eq=False)
class BodyPicture:
    """Crop of the colour picture around the body, possibly shrunk.

    Attributes
    ----------
    rgb : ndarray (h, w, 3) uint8
    darkness : ndarray (h, w) float32
        Minus the logarithm of the grey value: differences do not depend on the light.
    shrink : int
        Picture pixels per pixel of the crop.
    origin : tuple of int
        Picture pixel (u, v) of the crop's first pixel's upper left corner.
    cell : int
        Crop pixels per cell of the body map, about the distance of two depth measurements.
    on_body : ndarray (rows, columns) bool
        Cells in which the depth camera saw the body.
    vertex : ndarray (rows, columns) int32
        The surface's vertex in the cell, the one nearest to the camera, or that of the nearest cell with one.
    pixels_per_m : float
        Crop pixels per metre of skin seen square on, at the body's median distance.
    """

    rgb: NDArray[np.uint8]
    darkness: Image
    shrink: int
    origin: tuple[int, int]
    cell: int
    on_body: BoolImage
    vertex: NDArray[np.int32]
    pixels_per_m: float

    def to_picture(self, places: FloatArray) -> FloatArray:
        """Picture pixels (n, 2) of crop pixels (n, 2)."""
        return np.asarray((places + 0.5) * self.shrink - 0.5 + self.origin)

    def cells_at(self, places: FloatArray) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Row and column of the cell in which crop pixels (..., 2) lie, clipped to the map."""
        found = np.floor((places + 0.5) / self.cell).astype(np.int64)
        rows, columns = self.on_body.shape
        return np.clip(found[..., 1], 0, rows - 1), np.clip(found[..., 0], 0, columns - 1)

    def mask(self, cells: BoolImage) -> BoolImage:
        """A map of cells in crop pixels (h, w)."""
        h, w = self.darkness.shape
        size = (cells.shape[1] * self.cell, cells.shape[0] * self.cell)
        large = cv2.resize(cells.view(np.uint8), size, interpolation=cv2.INTER_NEAREST)
        return np.ascontiguousarray(large[:h, :w]).view(np.bool_)


def cut_body_picture(scan: BodyScan) -> BodyPicture | None:
    """Cut the body out of the scan's colour picture; None if there is no picture or no body in it."""
    color = scan.capture.color
    if color is None:
        return None
    rig = scan.capture.rig
    camera = rig.picture_camera
    pixels = scan.vertex_picture_pixels
    inside = camera.contains(pixels)
    if not inside.any():
        return None
    depth = rig.picture_from_depth.apply(scan.surface.vertices[inside])[:, 2]
    per_m = camera.fx / float(np.median(depth))
    shrink = max(1, int(per_m / _PIXELS_PER_M))
    shown = pixels[inside]
    margin = _MARGIN_M * per_m + 2 * shrink
    low = np.maximum(np.floor(shown.min(axis=0) - margin), 0).astype(int)
    high = np.minimum(np.ceil(shown.max(axis=0) + margin) + 1, (camera.width, camera.height)).astype(int)
    size = (high - low) // shrink
    high = low + size * shrink
    if (size < 8).any():
        return None
    rgb = np.ascontiguousarray(color[low[1] : high[1], low[0] : high[0]])
    if shrink > 1:
        rgb = cv2.resize(rgb, (int(size[0]), int(size[1])), interpolation=cv2.INTER_AREA)
    grey = cv2.transform(rgb, _GREY_WEIGHTS)
    darkness = np.asarray(cv2.LUT(grey, -_LOGARITHM), np.float32)
    spacing = camera.fx / scan.surface.camera.fx / shrink
    cell = max(1, int(np.ceil(1.1 * spacing)))
    on_body, vertex = _body_map((shown - low + 0.5) / shrink / cell, depth, size // cell + 1)
    return BodyPicture(
        rgb=np.asarray(rgb, np.uint8),
        darkness=darkness,
        shrink=shrink,
        origin=(int(low[0]), int(low[1])),
        cell=cell,
        on_body=on_body,
        vertex=np.flatnonzero(inside).astype(np.int32)[vertex],
        pixels_per_m=per_m / shrink,
    )


def _body_map(
    cells: FloatArray, depth: FloatArray, size: NDArray[np.int64]
) -> tuple[BoolImage, NDArray[np.int32]]:
    """Which cells show the body, and the row of the nearest vertex for every cell.

    ``cells`` (n, 2) are the vertices' places in cells, ``size`` the numbers of columns and rows.
    """
    hit = np.zeros((int(size[1]), int(size[0])), np.uint8)
    first = np.full(hit.shape, -1, np.int32)
    order = np.argsort(-depth, kind="stable")
    columns, rows = np.minimum(cells[order].astype(int), size - 1).T
    hit[rows, columns] = 1
    first[rows, columns] = order
    _, label = cv2.distanceTransformWithLabels(
        1 - hit, cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_PIXEL
    )
    of_label = np.zeros(int(label.max()) + 1, np.int32)
    of_label[label[hit > 0]] = first[hit > 0]
    on_body = cv2.morphologyEx(hit, cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))
    return on_body.astype(np.bool_), of_label[label]
