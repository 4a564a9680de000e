"""The optional library pyrealsense2: loaded only when a RealSense camera or recording is opened."""

from __future__ import annotations

import importlib
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from core.errors import WorkError

_INTEL = "8086"
_USB = Path("/sys/bus/usb/devices")


def is_installed() -> bool:
    """Whether the library is there; does not load it."""
    return find_spec("pyrealsense2") is not None


def load() -> Any:
    """The library.

    Raises
    ------
    WorkError
        If it is not installed or does not load, with what to do.
    """
    try:
        return importlib.import_module("pyrealsense2")
    except ImportError as error:
        raise WorkError(
            "RealSense cameras need the library pyrealsense2, which is not installed or does not load.",
            "Install it with: pip install 'geoderm[realsense]'.",
        ) from error


def may_be_connected(usb: Path = _USB) -> bool:
    """False if the kernel's list shows no Intel device at all: then the library need not be started."""
    if not usb.is_dir():
        return True
    for vendor in usb.glob("*/idVendor"):
        try:
            if vendor.read_text(encoding="ascii").strip().lower() == _INTEL:
                return True
        except (OSError, UnicodeDecodeError):
            continue
    return False
