"""Model and serial number of the webcams that Linux knows, and which of its nodes are cameras."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

SYSTEM = Path("/sys/class/video4linux")


@dataclass(frozen=True)
class VideoNode:
    """A camera of the kernel's list.

    Attributes
    ----------
    number : int
        N of ``/dev/videoN``.
    model : str
    serial : str
        The USB serial number; without one, vendor, product and the socket it is plugged into.
    lasting : bool
        Whether `serial` is a serial number.
    """

    number: int
    model: str
    serial: str
    lasting: bool


def video_nodes(system: Path = SYSTEM) -> list[VideoNode]:
    """Cameras that take pictures, by number; nodes that carry only metadata are left out."""
    found = []
    for entry in system.glob("video*"):
        digits = entry.name.removeprefix("video")
        if digits.isdigit() and _text(entry / "index") in ("", "0"):
            found.append(_node(entry, int(digits)))
    return sorted(found, key=lambda node: node.number)


def video_node(number: int, system: Path = SYSTEM) -> VideoNode | None:
    """The camera ``/dev/videoN``, or None where the kernel does not tell (other systems)."""
    entry = system / f"video{number}"
    return _node(entry, number) if entry.exists() else None


def node_of_path(path: Path) -> int | None:
    """N of a device path, also of the lasting links in ``/dev/v4l/by-id``."""
    name = path.resolve().name
    digits = name.removeprefix("video")
    return int(digits) if name.startswith("video") and digits.isdigit() else None


def _node(entry: Path, number: int) -> VideoNode:
    model = _text(entry / "name") or f"Camera {number}"
    usb = _usb_device(entry)
    if usb is None:
        return VideoNode(number, model, f"uvc-{number}", False)
    product = f"{_text(usb / 'idVendor')}:{_text(usb / 'idProduct')}"
    serial = _text(usb / "serial")
    if serial:
        return VideoNode(number, model, f"{product}-{serial}", True)
    return VideoNode(number, model, f"{product}@{usb.name}", False)


def _usb_device(entry: Path) -> Path | None:
    """The USB device above a video node: the first folder upwards with a vendor number."""
    try:
        start = (entry / "device").resolve(strict=True)
    except OSError:
        return None
    for folder in (start, *start.parents):
        if (folder / "idVendor").exists():
            return folder
    return None


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8", errors="replace").strip()
    except OSError:
        return ""
