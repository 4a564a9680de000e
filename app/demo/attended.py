"""The demonstration clinic for a person to play with."""

from __future__ import annotations

import sys
from pathlib import Path

from app.demo.clinic import PASSWORD, USERNAME, has_demo_clinic, prepare_demo_clinic
from app.demo.scene import DemoCameras
from app.gui import run_gui
from app.paths import default_data_dir
from app.windows.main_window import MainWindow


def run_attended(data: Path | None) -> int:
    """Prepare the clinic if it is not there, and open it with the demonstration's user signed in."""
    folder = data or default_data_dir().with_name("demonstration")
    if not has_demo_clinic(folder):
        from devices.trackers import default_tracker

        print("Preparing the demonstration clinic (about a minute, once) ...", flush=True)
        prepare_demo_clinic(folder, default_tracker, progress=_print_progress)
        print(f"\rThe demonstration clinic is in {folder}", flush=True)
    print(f"Signed in as '{USERNAME}' (password '{PASSWORD}').", flush=True)
    return run_gui(folder, cameras=DemoCameras(), demonstration=True, when_open=_sign_in)


def _sign_in(window: MainWindow) -> None:
    user = window.context.store.users.authenticate(USERNAME, PASSWORD)
    if user is not None:
        window.context.log_in(user)
        window.login.logged_in.emit()


def _print_progress(fraction: float, message: str = "") -> None:
    sys.stdout.write(f"\r{fraction:4.0%}  {message:<40}")
    sys.stdout.flush()
