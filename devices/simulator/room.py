"""The consulting room: where patient, camera, walls and other people stand.

World frame: x to the right as the camera sees it, y away from the camera, z up; the origin is on the floor
under the patient.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from core.capture.camera import PinholeCamera
from core.capture.rgbd import CameraRig
from core.capture.sensors import DEFAULT_SENSOR, SensorModel, sensor_model
from core.capture.transform import RigidTransform
from core.errors import InputError
from devices.simulator.body import rotation_about
from devices.simulator.skin import linear
from devices.simulator.stage import Plane

FloatArray = NDArray[np.float64]

VIEW_TURN_DEG = {"front": 0.0, "back": 180.0, "left": -90.0, "right": 90.0}
"""Turn of the patient, toward the patient's own left, that shows each side to the camera."""

AUXILIARY_SIZE = (2560, 1920)
_MILD_DISTORTION = (0.045, -0.09, 0.0006, -0.0004, 0.02)


@dataclass(frozen=True)
class Bystander:
    """A second person in the room, dressed.

    Attributes
    ----------
    shape, stance : str
    right_m, behind_m : float
        Place against the patient, as the camera sees it.
    turn_deg : float
    """

    shape: str = "f_young_avg"
    stance: str = "down"
    right_m: float = 0.95
    behind_m: float = 0.35
    turn_deg: float = 25.0


@dataclass(frozen=True)
class Room:
    """Surroundings of the patient.

    Attributes
    ----------
    floor : bool
    wall_behind_m : float or None
        Distance from the patient's axis to the wall behind; None for an open room.
    wall_yaw_deg : float
        How far the wall is from square to the camera.
    camera_tilt_deg : float
        Downward tilt of the camera.
    bystander : Bystander or None
    """

    floor: bool = True
    wall_behind_m: float | None = 1.0
    wall_yaw_deg: float = 2.0
    camera_tilt_deg: float = 0.0
    bystander: Bystander | None = None

    def depth_from_world(self, distance_m: float, height_m: float) -> RigidTransform:
        """Frame of a depth camera at this distance from the patient and height over the floor."""
        level = np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]])
        tilt = rotation_about((1, 0, 0), np.deg2rad(self.camera_tilt_deg))
        rotation = tilt @ level
        return RigidTransform(rotation, -rotation @ np.array([0.0, -distance_m, height_m]))

    def planes(self, depth_from_world: RigidTransform) -> list[Plane]:
        """Floor and wall in the depth camera's frame."""
        found: list[tuple[FloatArray, float, FloatArray]] = []
        if self.floor:
            found.append((np.array([0.0, 0.0, 1.0]), 0.0, linear((0.58, 0.55, 0.52))))
        if self.wall_behind_m is not None:
            normal = rotation_about((0, 0, 1), np.deg2rad(self.wall_yaw_deg)) @ np.array([0.0, 1.0, 0.0])
            found.append((normal, self.wall_behind_m, linear((0.76, 0.79, 0.80))))
        planes = []
        for normal, offset, color in found:
            turned = depth_from_world.rotate(normal)
            planes.append(Plane(turned, offset + float(turned @ depth_from_world.translation), color))
        return planes


@dataclass(frozen=True)
class SimulatedRig:
    """The virtual cameras.

    Attributes
    ----------
    sensor : SensorModel
    rig : CameraRig
        Depth and colour camera, as calibrated.
    device_seed : int
        Which device: fixes its ripple and where the colour camera sits.
    """

    sensor: SensorModel
    rig: CameraRig
    device_seed: int = 0

    @property
    def color(self) -> PinholeCamera:
        """The colour camera."""
        return self.rig.picture_camera

    @property
    def color_from_depth(self) -> RigidTransform:
        """Colour-camera frame from depth-camera frame."""
        return self.rig.picture_from_depth


def make_rig(
    color_size: tuple[int, int] = AUXILIARY_SIZE,
    *,
    distortion: bool = False,
    device_seed: int = 0,
    sensor: str = DEFAULT_SENSOR,
) -> SimulatedRig:
    """Virtual depth sensor with its own colour camera, or with an auxiliary camera of any other size.

    The sensor's own colour camera (``color_size`` is its size: 640 x 480 for a Kinect v1) stands as made,
    parallel. The auxiliary camera is mounted 25 to 60 mm away and up to about a degree askew, differently
    for every ``device_seed``.

    Raises
    ------
    InputError
        If there is no such sensor, or the picture is too small.
    """
    model = sensor_model(sensor)
    width, height = color_size
    if width < 16 or height < 16:
        raise InputError("The simulated colour picture must be at least 16 x 16 pixels.")
    focal = 525.0 * max(width / 640.0, height / 480.0)
    coefficients = _MILD_DISTORTION if distortion else ()
    own = model.color_camera
    if color_size == (own.width, own.height):
        color, color_from_depth = replace(own, distortion=coefficients), model.color_from_depth
    else:
        rng = np.random.default_rng((0xCA3, device_seed))
        shift = rng.uniform(-0.006, 0.006, 2) * width
        color = PinholeCamera(
            width,
            height,
            focal * float(rng.uniform(0.995, 1.005)),
            focal * float(rng.uniform(0.995, 1.005)),
            (width - 1) / 2 + float(shift[0]),
            (height - 1) / 2 + float(shift[1]),
            coefficients,
        )
        place = np.array([rng.choice((-1.0, 1.0)) * 0.8, -0.55, rng.uniform(-0.2, 0.2)])
        place *= rng.uniform(0.025, 0.060) / np.linalg.norm(place)
        axis = rng.normal(size=3)
        rotation = rotation_about(axis, np.deg2rad(rng.uniform(0.3, 1.2)))
        color_from_depth = RigidTransform(rotation, -rotation @ place)
    return SimulatedRig(model, CameraRig(model.depth_camera, color, color_from_depth), device_seed)


@dataclass(frozen=True)
class Variation:
    """What nature varies between two captures of one person, even in the same stance.

    Attributes
    ----------
    jitter_deg : float
        Of every limb's direction, per axis.
    twist_deg : float
        Of the upper arm about its own axis (the forearm turns 1.5 times as much).
    slide : bool
        Whether skin slides over bent joints.
    breath_m : float
        Lift of the chest from empty to full.
    sway_m : float
        RMS of the head's sway while the frames are taken.
    weight_share : float
        Standard deviation of the volume between visits, on top of a planned change.
    torso_slide : bool
        Whether raised arms draw the skin over shoulder blades and chest muscles, by 5 to 8 mm.
    faint_share : float
        Share of the moles that hardly stand out at a visit; another share at the next visit.
    tan : float
        By up to which share all moles stand out less at some visits (tanned skin, flat light).
    """

    jitter_deg: float = 3.0
    twist_deg: float = 8.0
    slide: bool = True
    breath_m: float = 0.004
    sway_m: float = 0.003
    weight_share: float = 0.0
    torso_slide: bool = False
    faint_share: float = 0.0
    tan: float = 0.0


DEMANDING = Variation(torso_slide=True, faint_share=0.06, tan=0.25)
"""What evaluations use: everything that the default varies, sliding torso skin, and moles that fade."""

STILL = Variation(0.0, 0.0, slide=False, breath_m=0.0, sway_m=0.0)
"""A dummy that neither breathes nor sways: for tests."""


@dataclass(frozen=True)
class VisitChange:
    """What is different from a visit on; changes of earlier visits stay.

    Attributes
    ----------
    new_moles, vanished : int
        Moles that came and went. Lesions of interest do not vanish.
    weight_change : float
        Change of body volume against the first visit, for example 0.05.
    growth : mapping of str to float
        Factor of the radius of some moles.
    healed : tuple of str
        Moles, lesions of interest too, whose pigment is gone: a faint pale scar is left in their place.
    """

    new_moles: int = 0
    vanished: int = 0
    weight_change: float | None = None
    growth: dict[str, float] = field(default_factory=dict)
    healed: tuple[str, ...] = ()
