"""The rig of a recording or device: from a calibration beside the file, else the sensor's nominal geometry.

OpenNI2 tells only the field of view: no principal point, no distortion, no transform between the cameras.
``NAME.oni.calibration.json`` beside a recording holds them: ``{"format": "geoderm-rig/1",
"depth": INTRINSICS, "color": INTRINSICS, "color_from_depth": 4x4, "picture": FILE, "sensor": NAME,
"nominal": BOOL, "profile": DOCUMENT, "corrected": BOOL}`` with intrinsics as in the capture folder.
``picture`` is an optional still of an auxiliary camera that is not an OpenNI2 stream; ``color`` then
describes it instead of the colour stream. ``profile`` is the calibration profile that the camera had, and
``corrected`` tells whether its depth correction is already in the frames (true unless it says otherwise).
``nominal`` marks a geometry that was never calibrated.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from core.calibration.camera_document import CameraDocument
from core.calibration.profile import CalibrationProfile
from core.capture.camera import PinholeCamera
from core.capture.fields import read_bytes
from core.capture.rgbd import CameraRig
from core.capture.transform import RigidTransform
from core.errors import GeodermError, InputError
from devices.openni.streams import StreamInfo

KINECT_DEPTH_FX_AT_640 = 575.8
KINECT_COLOR_FX_AT_640 = 525.0
KINECT_COLOR_FROM_DEPTH = RigidTransform(np.eye(3), np.array([-0.025, 0.0, 0.0]))
NOMINAL_WARNING = (
    "The camera is not calibrated: nominal Kinect geometry is used, and clicks on the picture may miss the "
    "skin by about a centimetre. Calibrate the camera."
)
_FORMAT = "geoderm-rig/1"
_LIMIT_BYTES = 1_000_000
_LIMIT_PICTURE_BYTES = 200_000_000


class _RigFile(BaseModel):
    model_config = ConfigDict(extra="ignore")
    format: str
    depth: CameraDocument
    color: CameraDocument | None = None
    color_from_depth: list[list[Annotated[float, Field(ge=-100, le=100)]]] | None = None
    picture: str | None = None
    sensor: str = ""
    nominal: bool = False
    profile: dict[str, Any] | None = None
    corrected: bool = True


@dataclass(frozen=True, eq=False)
class RigCalibration:
    """What lies beside a recording.

    Attributes
    ----------
    rig : CameraRig
    picture : ndarray (h, w, 3) uint8 or None
        Of an auxiliary camera, if one took it.
    sensor : str
        Name of the noise model; empty if unknown.
    nominal : bool
        True if the geometry was never calibrated.
    profile : CalibrationProfile or None
        What the camera was calibrated with.
    corrected : bool
        Whether the profile's depth correction is already in the frames.
    """

    rig: CameraRig
    picture: NDArray[np.uint8] | None = None
    sensor: str = ""
    nominal: bool = False
    profile: CalibrationProfile | None = None
    corrected: bool = True


def calibration_path(recording: Path) -> Path:
    """Where the calibration of a recording lies."""
    return recording.with_name(recording.name + ".calibration.json")


def picture_path(recording: Path) -> Path:
    """Where the auxiliary camera's picture of a recording lies."""
    return recording.with_name(recording.name + ".picture.png")


def read_calibration(recording: Path) -> RigCalibration | None:
    """Calibration beside a recording, or None if there is none.

    Raises
    ------
    InputError
        If there is one and it cannot be used.
    """
    path = calibration_path(recording)
    if not path.exists():
        return None
    data = read_bytes(path, _LIMIT_BYTES)
    try:
        content = _RigFile.model_validate_json(data)
    except ValidationError as error:
        first = error.errors()[0]
        field = ".".join(str(p) for p in first["loc"]) or "file"
        raise InputError(f"{path}: {field}: {first['msg']}.") from error
    if content.format != _FORMAT:
        raise InputError(f"{path}: format: expected {_FORMAT}.")
    try:
        color = content.color.camera() if content.color else None
        transform = (
            RigidTransform.from_matrix(content.color_from_depth)
            if content.color_from_depth is not None
            else None
        )
        rig = CameraRig(content.depth.camera(), color, transform)
    except (GeodermError, ValueError) as error:
        raise InputError(f"{path}: {error}") from error
    profile = content.profile
    return RigCalibration(
        rig,
        _read_picture(path, content.picture, rig),
        content.sensor,
        content.nominal,
        None if profile is None else CalibrationProfile.from_document(profile, f"{path}: profile"),
        content.corrected,
    )


def _read_picture(path: Path, name: str | None, rig: CameraRig) -> NDArray[np.uint8] | None:
    if name is None:
        return None
    if Path(name).name != name:
        raise InputError(f"{path}: picture: must name a file in the same folder.")
    import cv2

    file = path.with_name(name)
    data = np.frombuffer(read_bytes(file, _LIMIT_PICTURE_BYTES), np.uint8)
    try:
        bgr = cv2.imdecode(data, cv2.IMREAD_COLOR) if data.size else None
    except cv2.error:
        bgr = None
    if bgr is None:
        raise InputError(f"{file}: not a readable picture.", "Copy it beside the recording again.")
    camera = rig.color
    if camera is None or bgr.shape[:2] != (camera.height, camera.width):
        raise InputError(f"{file}: the picture's size differs from the colour camera in {path.name}.")
    return np.ascontiguousarray(bgr[..., ::-1])


def write_calibration(
    recording: Path,
    rig: CameraRig,
    picture: NDArray[np.uint8] | None = None,
    *,
    sensor: str = "",
    nominal: bool = False,
    profile: Mapping[str, Any] | None = None,
    corrected: bool = True,
) -> None:
    """Write the calibration of a recording, and the auxiliary camera's picture, beside it.

    Parameters are those of `RigCalibration`, the profile as its document.
    """
    import cv2

    name = None
    if picture is not None:
        name = picture_path(recording).name
        cv2.imwrite(str(picture_path(recording)), picture[..., ::-1])
    content = {
        "format": _FORMAT,
        "depth": rig.depth.document(),
        "color": rig.color.document() if rig.color else None,
        "color_from_depth": rig.color_from_depth.matrix.tolist() if rig.color_from_depth else None,
        "picture": name,
        "sensor": sensor,
        "nominal": nominal,
        "profile": profile,
        "corrected": corrected,
    }
    calibration_path(recording).write_text(json.dumps(content, indent=1), encoding="utf-8")


def nominal_rig(depth: StreamInfo, color: StreamInfo | None) -> CameraRig:
    """Geometry of a Kinect-class sensor, with the focal length from the field of view where it is told."""
    return CameraRig(
        _nominal_camera(depth, KINECT_DEPTH_FX_AT_640),
        _nominal_camera(color, KINECT_COLOR_FX_AT_640) if color else None,
        KINECT_COLOR_FROM_DEPTH if color else None,
    )


def check_profile_sizes(
    profile: CalibrationProfile, depth_size: tuple[int, int] | None, color_size: tuple[int, int] | None
) -> None:
    """Refuse a profile for other image sizes (width, height); None is a stream that does not run."""
    for name, camera, size in (
        ("depth", profile.rig.depth, depth_size),
        ("colour", profile.rig.color, color_size),
    ):
        if camera is not None and size is not None and (camera.width, camera.height) != size:
            raise InputError(
                f"The calibration is for {camera.width} x {camera.height} {name} pictures, the camera "
                f"delivers {size[0]} x {size[1]}.",
                "Choose the mode it was calibrated in, or calibrate this mode.",
            )


def _nominal_camera(stream: StreamInfo, fx_at_640: float) -> PinholeCamera:
    if stream.fov_rad is not None:
        f = stream.width / 2 / float(np.tan(stream.fov_rad / 2))
    else:
        f = fx_at_640 * stream.width / 640
    return PinholeCamera(stream.width, stream.height, f, f, (stream.width - 1) / 2, (stream.height - 1) / 2)
