"""Runs the hand window by itself, without a clinic."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from core.errors import InputError

if TYPE_CHECKING:
    from devices.camera import DepthCamera


def run_hand_window(source: str | None, model: Path | None) -> int:
    """Show the window until it is closed; return the exit code.

    Parameters
    ----------
    source : str or None
        A folder of captures, an ``.oni`` file, or the id of a live camera.
    model : Path or None

    Raises
    ------
    GeodermError
        If source or model cannot be what they are said to be.
    """
    recording = _recording(source)
    if model is not None and not model.is_file():
        raise InputError(f"{model}: there is no such file.", "Give a model made by geoderm hand train.")

    from app.context import RegisteredCameras
    from app.gui import application
    from app.logs import start_logging
    from app.tasks import TaskRunner, install_excepthook
    from app.widgets.body_backend import body_backend
    from app.windows.hand.desk import HandDesk
    from app.windows.hand.window import HandWindow

    start_logging()
    app = application()
    tasks = TaskRunner()
    cameras = RegisteredCameras()
    window = HandWindow(HandDesk(tasks, cameras, _open_with_profile))
    install_excepthook(window.banner.show_failure)
    window.show()
    if model is not None:
        window.load_model(model)
    if recording is not None:
        window.open_recording(recording)
    elif source is not None:
        window.open_camera(source)
    body_backend().load()
    try:
        return app.exec()
    finally:
        tasks.shut_down()
        body_backend().join()


def _recording(source: str | None) -> Path | None:
    """The path that a source names; None for a camera's id or nothing."""
    if source is None:
        return None
    path = Path(source)
    if path.exists():
        return path
    from devices.registry import camera_kinds

    kind, colon, _ = source.partition(":")
    if colon and kind in camera_kinds():
        return None
    raise InputError(
        f"{source}: is neither a recording nor a camera.",
        "Give a folder of capture folders, a .oni file, or an id that 'geoderm devices' lists.",
    )


def _open_with_profile(camera_id: str) -> DepthCamera:
    from app.paths import calibration_dir
    from core.calibration.profile import ProfileStore
    from devices.registry import open_device

    return open_device(camera_id, ProfileStore(calibration_dir()))
