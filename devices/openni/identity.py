"""Which camera an OpenNI2 device is: model, serial number, kind of sensor."""

from __future__ import annotations

from devices.live import CameraIdentity
from devices.openni.session import OpenedDevice

_KINECT_V1 = "kinect-v1"
_KINECT_V2 = "kinect-v2"
_REALSENSE = "realsense-d4xx"
_PRIMESENSE_USB = 0x1D27  # PrimeSense Carmine and Asus Xtion: the Kinect's principle and baseline
_MICROSOFT_USB = 0x045E
_MICROSOFT_CAMERAS = {0x02AE: _KINECT_V1, 0x02BF: _KINECT_V1, 0x02C4: _KINECT_V2, 0x02D8: _KINECT_V2}
_SCHEMES = {"freenect": _KINECT_V1, "freenect2": _KINECT_V2}


def identity_of(device: OpenedDevice | None, uri: str, name: str) -> CameraIdentity:
    """Identity of an opened device, or what the address alone tells before."""
    if device is None:
        return CameraIdentity(name, uri, uri, sensor_of((0, 0), uri, name), lasting=False)
    serial = device.serial or device.uri
    maker = device.vendor if device.vendor and device.vendor not in device.name else ""
    return CameraIdentity(
        model=f"{maker} {device.name}".strip(),
        depth_serial=serial,
        color_serial=serial if "color" in device.kinds else "",
        sensor=sensor_of(device.usb, device.uri, device.name),
        lasting=bool(device.serial),
    )


def sensor_of(usb: tuple[int, int], uri: str, name: str) -> str:
    """Name of the sensor's noise model; empty if the device is of none of the known kinds."""
    vendor, product = usb
    if vendor == _MICROSOFT_USB and product in _MICROSOFT_CAMERAS:
        return _MICROSOFT_CAMERAS[product]
    if vendor == _PRIMESENSE_USB:
        return _KINECT_V1
    scheme = uri.partition("://")[0]
    if "realsense" in name.lower():
        return _REALSENSE
    return _SCHEMES.get(scheme, "")
