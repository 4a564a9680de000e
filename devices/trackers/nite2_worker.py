"""The process in which NiTE2 runs: proprietary native code whose crash or hang must cost no consultation.

Requests are ``(operation, arguments)``; answers ``("done", value)`` or ``("error", message, advice)``.
"""

from __future__ import annotations

import os
import signal
import sys
import time
from importlib import import_module
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, Final

import numpy as np

from core.anchors.tracked import TrackedPerson
from core.capture.camera import PinholeCamera
from core.errors import GeodermError, WorkError
from devices.openni.binding import binding_part, load_binding
from devices.openni.runtime import load_runtime
from devices.trackers.nite2_joints import person_of, wants_start

_LIBRARY: Final = {"win32": "NiTE2.dll", "darwin": "libNiTE2.dylib"}.get(sys.platform, "libNiTE2.so")
_AGAIN_S: Final = 1.0


def nite_folders() -> list[Path]:
    """Folders where the runtime may be, best first: the environment's word, then each platform's places."""
    named = [os.environ.get(k) for k in ("NITE2_REDIST64", "NITE2_REDIST")]
    folders = [Path(n) for n in named if n]
    if sys.platform == "win32":
        program_files = Path(os.environ.get("PROGRAMFILES", "C:/Program Files"))
        folders += [program_files / "PrimeSense/NiTE2/Redist", program_files / "NiTE2/Redist"]
    else:
        folders += [Path(p) for p in ("/usr/lib/NiTE2", "/usr/local/lib", "/usr/local/lib/NiTE2", "/usr/lib")]
        folders += sorted(Path("/opt").glob("*NiTE*2*/Redist"))
    return folders


def load_nite() -> Any:
    """The binding's ``nite2`` module with both runtimes initialised.

    Raises
    ------
    WorkError
        If one of them cannot be loaded; the message names the folders that were tried.
    """
    folder = _find_library()
    load_runtime()
    nite2 = nite_binding("nite2")
    try:
        nite2.initialize([str(folder)])
    except Exception as error:
        raise WorkError(
            f"NiTE2 in {folder} could not be started: {str(error).strip().splitlines()[-1].strip()}",
            "Its data folder NiTE2 must lie beside the library.",
        ) from error
    return nite2


def nite_binding(name: str) -> Any:
    """A module of the binding's NiTE2 part: ``nite2``, or ``_nite2`` for the C interface.

    The binding imports its own ``_openni2`` by the bare name, as Python 2 allowed; it is lent that name.
    """
    interface = binding_part("_openni2")
    package = interface.__name__.rpartition(".")[0]
    lent = "_openni2" not in sys.modules
    if lent:
        sys.modules["_openni2"] = interface
    try:
        return import_module(f"{package}.{name}")
    finally:
        if lent:
            del sys.modules["_openni2"]


def _find_library() -> Path:
    load_binding()
    folders = nite_folders()
    for folder in folders:
        if (folder / _LIBRARY).is_file():
            return folder
    raise WorkError(
        f"The NiTE2 runtime ({_LIBRARY}) was not found; looked in {', '.join(map(str, folders))}.",
        "It is proprietary and no part of GeoDerm. Install it and set NITE2_REDIST64 to its Redist folder, "
        "or use MediaPipe.",
    )


class Follower:
    """NiTE2's user tracker on one source."""

    def __init__(self) -> None:
        self._nite2: Any = None
        self._device: Any = None
        self._tracker: Any = None
        self._nominal: PinholeCamera | None = None
        self._asked: dict[int, float] = {}

    def start(self, source: str) -> None:
        """Open the source and begin to look for people."""
        self._nite2 = load_nite()
        openni2 = self._nite2.openni2
        if source:
            is_file = Path(source).is_file()
            opened = openni2.Device.open_file if is_file else openni2.Device
            self._device = opened(source.encode())
        else:
            self._device = openni2.Device.open_any()
        stream = self._device.create_depth_stream()
        mode = stream.get_video_mode()
        self._nominal = nominal_camera(
            mode.resolutionX, mode.resolutionY, stream.get_horizontal_fov(), stream.get_vertical_fov()
        )
        stream.close()
        self._tracker = self._nite2.UserTracker(self._device)

    def read(self, camera: PinholeCamera | None = None) -> TrackedPerson:
        """The next frame; blocks until there is one."""
        if self._tracker is None:
            raise WorkError("The NiTE2 tracker was not started.")
        frame = self._tracker.read_frame()
        try:
            for user in frame.users:
                self._ask(user)
            eye = self._nominal if camera is None else camera
            if eye is None:
                raise WorkError("The camera told no field of view; a calibrated camera is needed.")
            return person_of(frame.users, int(frame.timestamp), eye, self._nominal)
        finally:
            frame.close()

    def _ask(self, user: Any) -> None:
        """Ask for the user's skeleton, and again some time after a calibration failed."""
        number, now = int(user.id), time.monotonic()
        if wants_start(user) and now - self._asked.get(number, -np.inf) > _AGAIN_S:
            self._asked[number] = now
            self._tracker.start_skeleton_tracking(number)


def nominal_camera(width: int, height: int, hfov_rad: float, vfov_rad: float) -> PinholeCamera | None:
    """The ideal camera of a field of view; None if the driver told none (it then tells nonsense)."""
    if not (0.2 < hfov_rad < 2.5 and 0.2 < vfov_rad < 2.5):
        return None
    fx, fy = width / 2 / np.tan(hfov_rad / 2), height / 2 / np.tan(vfov_rad / 2)
    return PinholeCamera(width, height, float(fx), float(fy), (width - 1) / 2, (height - 1) / 2)


def serve(pipe: Connection) -> None:
    """Answer requests until the other side closes the pipe, then leave without native clean-up."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    follower = Follower()
    try:
        while True:
            operation, arguments = pipe.recv()
            try:
                pipe.send(("done", getattr(follower, operation)(**arguments)))
            except GeodermError as error:
                pipe.send(("error", error.message, error.advice))
            except Exception as error:  # noqa: BLE001 - the binding raises bare kinds; all cross as messages
                said = str(error).strip().splitlines() or [type(error).__name__]
                pipe.send(("error", f"NiTE2: {said[0]}", ""))
    except (EOFError, OSError):
        pass
    finally:
        os._exit(0)
