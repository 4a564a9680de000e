"""``geoderm record``: what a camera sees, as an ``.oni`` file or as capture folders."""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

if TYPE_CHECKING:
    from devices.live import LiveCamera
    from devices.recordings.sources import FrameSource


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("record")(record)


def record(
    device: str = typer.Argument(help="Camera as `geoderm devices` lists it, or recording:PATH to copy."),
    out: Path = typer.Argument(help="New NAME.oni, or a new folder for capture folders."),
    seconds: float | None = typer.Option(None, "--seconds", min=0.01, help="End after this time."),
    frames: int | None = typer.Option(None, "--frames", min=1, help="End after this many depth frames."),
    burst: int = typer.Option(30, "--burst", min=1, max=300, help="Depth frames in each capture folder."),
    jpeg: bool = typer.Option(False, "--jpeg", help="Compress colour in a .oni file; loses a little."),
    profiles: Path | None = typer.Option(
        None, "--profiles", help="Folder of calibration profiles; the workstation's by default."
    ),
) -> None:
    """Record until the limit or Ctrl-C; either leaves a complete recording with its calibration beside it."""
    from app.paths import calibration_dir
    from core.calibration.profile import ProfileStore
    from core.errors import InputError
    from devices.recordings.recorder import Limits
    from devices.recordings.recorder import record as record_frames

    if out.exists() or out.is_symlink():
        raise InputError(f"{out}: exists already.", "Choose another name.")
    if not out.parent.is_dir():
        raise InputError(f"{out}: the folder it would be in does not exist.")
    if out.suffix.lower() != ".oni" and jpeg:
        raise InputError("--jpeg is for .oni files; capture folders keep colour without loss.")
    stop = threading.Event()
    if profiles is not None and not profiles.is_dir():
        raise InputError(f"{profiles}: there is no such folder of calibration profiles.")
    store = ProfileStore(profiles or calibration_dir())
    with _stopping_cleanly(stop), _opened(device, store) as source:
        report = record_frames(
            source, out, Limits(seconds, frames, stop), _Ticker(), burst=burst, lossy_color=jpeg
        )
    rate = report.frames / report.seconds if report.seconds > 0 else 0.0
    left_out = f", {report.left_out} left out" if report.left_out else ""
    typer.echo(
        f"{report.path}: {report.frames} depth frames in {report.seconds:.1f} s ({rate:.1f}/s){left_out}, "
        f"recorded by {report.recorder}, ended: {report.ended}"
    )


@contextmanager
def _opened(device: str, store: Any) -> Iterator[LiveCamera | FrameSource]:
    from core.errors import InputError
    from devices.live import LiveCamera
    from devices.recordings.sources import open_source
    from devices.registry import open_device

    kind, _, address = device.partition(":")
    if kind in ("recording", "folder") and not address.endswith("?live"):
        source = open_source(Path(address))
        try:
            yield source
        finally:
            source.close()
        return
    camera = open_device(device, store)
    try:
        if not isinstance(camera, LiveCamera):
            raise InputError(f"'{device}' cannot be recorded: it is no live camera.")
        yield camera
    finally:
        camera.close()


@contextmanager
def _stopping_cleanly(stop: threading.Event) -> Iterator[None]:
    """Ctrl-C and a polite request to end set ``stop`` instead of interrupting the work."""
    numbers = [signal.SIGINT, signal.SIGTERM]
    earlier: dict[Any, Any] = {}
    if threading.current_thread() is threading.main_thread():
        earlier = {n: signal.signal(n, lambda *_: stop.set()) for n in numbers}
    try:
        yield
    finally:
        for number, handler in earlier.items():
            signal.signal(number, handler)


class _Ticker:
    """Tells on a terminal how far the recording is."""

    def __init__(self) -> None:
        self._shown = ""

    def __call__(self, fraction: float, message: str = "") -> None:
        if not sys.stderr.isatty() or message == self._shown:
            return
        self._shown = message
        sys.stderr.write(f"\r{message} (Ctrl-C ends)   ")
        sys.stderr.flush()
