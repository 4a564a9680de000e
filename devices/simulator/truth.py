"""What a simulated capture really shows. Only tests and evaluations may look."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from core.capture.rgbd import CameraRig, RgbdCapture
from core.surface.points import SurfacePoint

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]
BoolArray = NDArray[np.bool_]

TRUTH_JSON = "simulated_truth.json"
TRUTH_ARRAYS = "simulated_truth.npz"
_FORMAT = "geoderm-simulated-truth/1"
_ARRAYS = (
    "vertices_m",
    "triangles",
    "pixel_numbers",
    "pixel_triangle",
    "pixel_uv",
    "mole_triangle",
    "mole_barycentric",
    "mole_points_m",
    "mole_pixels",
    "mole_depth_pixels",
    "mole_visible_color",
    "mole_visible_depth",
    "mole_radius_m",
)


@dataclass(frozen=True, eq=False)
class CaptureTruth:
    """Truth of one simulated capture. Positions are in the depth camera's frame, metres.

    A place on the skin is a triangle of the body mesh with barycentric weights: the same numbers are the same
    place in every stance, view and visit of a patient.

    Attributes
    ----------
    rig : CameraRig
    vertices_m : ndarray (n, 3)
        The patient's skin (over clothes and hair: their surface) in the middle of the capture.
    triangles : ndarray (m, 3) int32
    pixel_numbers : ndarray (k,) int32
        Flat numbers, ascending, of the picture's pixels that show the patient; `pixel_triangle` (k,) and
        `pixel_uv` (k, 2), the weights of the second and third corner, say which place at the pixel's centre.
    joints_m : dict of str to ndarray (3,)
        The 15 joints, interior, the subject's own left and right.
    mole_ids : tuple of str
    mole_triangle, mole_barycentric : ndarray (k,), (k, 3)
    mole_points_m : ndarray (k, 3)
    mole_pixels, mole_depth_pixels : ndarray (k, 2)
        In the colour picture and in the depth image; NaN where the mole is not seen by that camera.
    mole_visible_color, mole_visible_depth : ndarray (k,) bool
        Not hidden by the body, another person, clothes, hair, the image's border or a glancing angle.
    mole_radius_m : ndarray (k,)
    healed_ids : tuple of str
        Moles whose pigment is gone; a pale scar marks the place, and "visible" means that the place is.
    faint_ids : tuple of str
        Moles that hardly stand out at this visit.
    """

    rig: CameraRig
    vertices_m: FloatArray
    triangles: IntArray
    pixel_numbers: IntArray
    pixel_triangle: IntArray
    pixel_uv: NDArray[np.float32]
    joints_m: dict[str, FloatArray]
    mole_ids: tuple[str, ...]
    mole_triangle: IntArray
    mole_barycentric: FloatArray
    mole_points_m: FloatArray
    mole_pixels: FloatArray
    mole_depth_pixels: FloatArray
    mole_visible_color: BoolArray
    mole_visible_depth: BoolArray
    mole_radius_m: FloatArray
    healed_ids: tuple[str, ...] = ()
    faint_ids: tuple[str, ...] = ()

    @property
    def mole_visible(self) -> BoolArray:
        """Moles (k,) that both cameras see."""
        return self.mole_visible_color & self.mole_visible_depth

    @property
    def lesion_ids(self) -> tuple[str, ...]:
        """Ids of the lesions of interest."""
        return tuple(name for name in self.mole_ids if name.startswith("L"))

    @cached_property
    def mole_row(self) -> dict[str, int]:
        """Row of each mole by id."""
        return {name: k for k, name in enumerate(self.mole_ids)}

    @property
    def triangle(self) -> IntArray:
        """Triangle shown by every pixel of the picture (h, w); -1 where it does not show the patient."""
        camera = self.rig.picture_camera
        image = np.full(camera.height * camera.width, -1, np.int32)
        image[self.pixel_numbers] = self.pixel_triangle
        return image.reshape(camera.height, camera.width)

    @property
    def barycentric(self) -> NDArray[np.float32]:
        """Weights of the triangle's corners at the centre of every pixel, (h, w, 3); 0 off the patient."""
        camera = self.rig.picture_camera
        image = np.zeros((camera.height * camera.width, 3), np.float32)
        image[self.pixel_numbers, 0] = 1.0 - self.pixel_uv.sum(axis=1)
        image[self.pixel_numbers, 1:] = self.pixel_uv
        return image.reshape(camera.height, camera.width, 3)

    def position(self, triangle: ArrayLike, barycentric: ArrayLike) -> FloatArray:
        """Where places on the skin are in this capture: (3,) or (k, 3)."""
        corners = self.vertices_m[self.triangles[np.asarray(triangle)]]
        return np.asarray((corners * np.asarray(barycentric)[..., None]).sum(axis=-2))

    def surface_point_at(self, pixel: ArrayLike) -> SurfacePoint | None:
        """Skin shown at a picture pixel (u, v), sub-pixel; None off the patient."""
        camera = self.rig.picture_camera
        u, v = (float(x) for x in np.asarray(pixel, float))
        if not camera.contains([[u, v]])[0]:
            return None
        cu, cv = int(np.clip(round(u), 0, camera.width - 1)), int(np.clip(round(v), 0, camera.height - 1))
        around = [
            self._row(cu + du, cv + dv)
            for dv in (-1, 0, 1)
            for du in (-1, 0, 1)
            if 0 <= cu + du < camera.width and 0 <= cv + dv < camera.height
        ]
        origin, direction = self.rig.picture_rays([[u, v]])
        best: tuple[float, int, FloatArray] | None = None
        for triangle in np.unique(self.pixel_triangle[[row for row in around if row >= 0]]):
            t, weights = _meet_plane(self.vertices_m[self.triangles[triangle]], origin, direction[0])
            if t > 0 and weights.min() > -1e-6 and (best is None or t < best[0]):
                best = (t, int(triangle), weights)
        if best is None:
            own = self._row(cu, cv)
            if own < 0:
                return None
            s, t = (float(x) for x in self.pixel_uv[own])
            best = (0.0, int(self.pixel_triangle[own]), np.array([1.0 - s - t, s, t]))
        return SurfacePoint(best[1], best[2], self.position(best[1], best[2]))

    def _row(self, u: int, v: int) -> int:
        number = v * self.rig.picture_camera.width + u
        k = int(np.searchsorted(self.pixel_numbers, number))
        return k if k < len(self.pixel_numbers) and self.pixel_numbers[k] == number else -1


def _meet_plane(corners: FloatArray, origin: FloatArray, direction: FloatArray) -> tuple[float, FloatArray]:
    """Ray parameter and barycentric weights of a ray in the plane of a triangle; -1 if it runs along it."""
    system = np.column_stack([corners[1] - corners[0], corners[2] - corners[0], -direction])
    if abs(np.linalg.det(system)) < 1e-15:
        return -1.0, np.zeros(3)
    s, t, distance = np.linalg.solve(system, origin - corners[0])
    return float(distance), np.array([1.0 - s - t, s, t])


@dataclass(frozen=True, eq=False)
class SimulatedCapture:
    """A capture as a device would give it, and the truth behind it."""

    capture: RgbdCapture
    truth: CaptureTruth


def write_simulated(simulated: SimulatedCapture, folder: Path) -> None:
    """Write a capture folder with the truth beside it in files of their own, which the reader ignores."""
    from core.capture.folder import write_capture

    write_capture(simulated.capture, folder)
    truth = simulated.truth
    np.savez_compressed(
        folder / TRUTH_ARRAYS, allow_pickle=False, **{name: getattr(truth, name) for name in _ARRAYS}
    )
    text = {
        "format": _FORMAT,
        "simulated": True,
        "joints_m": {name: list(map(float, p)) for name, p in truth.joints_m.items()},
        "mole_ids": list(truth.mole_ids),
        "lesion_ids": list(truth.lesion_ids),
        "healed_ids": list(truth.healed_ids),
        "faint_ids": list(truth.faint_ids),
    }
    (folder / TRUTH_JSON).write_text(json.dumps(text, indent=1), encoding="utf-8")


def read_truth(folder: Path, rig: CameraRig) -> CaptureTruth:
    """Read the truth that `write_simulated` left beside a capture taken with ``rig``."""
    text = json.loads((folder / TRUTH_JSON).read_text(encoding="utf-8"))
    with np.load(folder / TRUTH_ARRAYS) as arrays:
        values = {name: arrays[name] for name in _ARRAYS}
    joints = {name: np.array(p, float) for name, p in text["joints_m"].items()}
    return CaptureTruth(
        rig=rig,
        joints_m=joints,
        mole_ids=tuple(text["mole_ids"]),
        healed_ids=tuple(text.get("healed_ids", ())),
        faint_ids=tuple(text.get("faint_ids", ())),
        **values,
    )
