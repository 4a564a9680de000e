"""What every device hands over: depth frames of one stance, a colour picture, and how the cameras stand."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from core.capture.camera import PinholeCamera
from core.capture.transform import RigidTransform
from core.errors import InputError

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class CameraRig:
    """The depth camera and, if there is one, the colour camera beside it.

    Attributes
    ----------
    depth : PinholeCamera
    color : PinholeCamera or None
    color_from_depth : RigidTransform or None
        Colour-camera frame from depth-camera frame. Thesis eq. 4 states the inverse.
    """

    depth: PinholeCamera
    color: PinholeCamera | None = None
    color_from_depth: RigidTransform | None = None

    def __post_init__(self) -> None:
        if (self.color is None) != (self.color_from_depth is None):
            raise InputError("A colour camera and its transform from the depth camera belong together.")

    @property
    def has_color(self) -> bool:
        """Whether there is a calibrated colour camera."""
        return self.color is not None

    @property
    def picture_camera(self) -> PinholeCamera:
        """The camera whose pixels a person clicks: the colour camera, or the depth camera without one."""
        return self.color if self.color is not None else self.depth

    @property
    def picture_from_depth(self) -> RigidTransform:
        """Frame of `picture_camera` from the depth-camera frame."""
        return self.color_from_depth if self.color_from_depth is not None else RigidTransform()

    def project_to_picture(self, points: ArrayLike) -> FloatArray:
        """Picture pixels (n, 2) of points (n, 3) in the depth-camera frame; NaN behind the camera."""
        return self.picture_camera.project(self.picture_from_depth.apply(points))

    def picture_rays(self, pixels: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Origin (3,) and directions (n, 3) in the depth-camera frame of rays through picture pixels.

        Directions have z = 1 in the picture camera's own frame, so the ray parameter is depth as that
        camera sees it.
        """
        depth_from_picture = self.picture_from_depth.inverse()
        return depth_from_picture.translation, depth_from_picture.rotate(self.picture_camera.rays(pixels))


@dataclass(frozen=True, eq=False)
class RgbdCapture:
    """One stance seen by one rig. Immutable; arrays must not be written to.

    Attributes
    ----------
    depth_frames : ndarray (n, height, width) uint16
        Raw depth; 0 means no measurement. Times `depth_unit_m` gives metres along the optical axis.
    depth_unit_m : float
    rig : CameraRig
    color : ndarray (height, width, 3) uint8 or None
        RGB, present exactly if the rig has a colour camera.
    view : str
        front, back, left, right or free text.
    stance : str
        Free text, for example "psi".
    taken_at : datetime
        Time zone aware.
    mirrored : bool
        True if the recording is a mirror image of the patient. `core.capture.mirror.unmirror` mends it.
    joints_m : dict of str to ndarray (3,) or None
        Recorded joints in the depth-camera frame, the subject's own left and right.
    warnings : tuple of str
        What the device knows to be less than it should be, for example a nominal calibration.
    sensor : str
        Name of the depth camera's noise model (`core.capture.sensors`); empty if unknown.
    calibration : dict or None
        Document of the calibration profile it was taken with (`core.calibration.profile`); its depth
        correction is already applied to the frames. None for nominal or foreign geometry.
    """

    depth_frames: NDArray[np.uint16]
    depth_unit_m: float
    rig: CameraRig
    color: NDArray[np.uint8] | None = None
    view: str = "front"
    stance: str = ""
    taken_at: datetime = field(default_factory=lambda: datetime.now(UTC))
    mirrored: bool = False
    joints_m: dict[str, FloatArray] | None = None
    warnings: tuple[str, ...] = ()
    sensor: str = ""
    calibration: dict[str, Any] | None = None

    def __post_init__(self) -> None:
        d, cam = self.depth_frames, self.rig.depth
        if d.ndim != 3 or len(d) == 0 or d.dtype != np.uint16:
            raise InputError("A capture needs at least one 16-bit depth frame.")
        if d.shape[1:] != (cam.height, cam.width):
            raise InputError(
                f"The depth frames are {d.shape[2]} x {d.shape[1]} pixels, but the depth camera says "
                f"{cam.width} x {cam.height}."
            )
        if not 0 < self.depth_unit_m < 1:
            raise InputError("The depth unit must be between 0 and 1 metre.")
        if (self.color is None) != (self.rig.color is None):
            raise InputError("A colour image and a colour camera belong together.")
        if self.color is not None and self.rig.color is not None:
            expected = (self.rig.color.height, self.rig.color.width, 3)
            if self.color.shape != expected or self.color.dtype != np.uint8:
                raise InputError(
                    f"The colour image is {self.color.shape[1]} x {self.color.shape[0]} pixels, but the "
                    f"colour camera says {self.rig.color.width} x {self.rig.color.height}."
                )

    def with_joints(self, joints_m: dict[str, FloatArray] | None) -> RgbdCapture:
        """The same capture with other recorded joints (None removes them)."""
        return replace(self, joints_m=joints_m)
