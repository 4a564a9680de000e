"""Small depth-only captures on disk, and one simulated stance that all tests share."""

from __future__ import annotations

import numpy as np
import pytest

from app.cli.evaluate_thesis import simulate_stances
from core.capture import CameraRig, PinholeCamera, RgbdCapture, write_capture
from core.evaluation.thesis import Clicks, write_clicks
from core.progress import no_progress

CAMERA = PinholeCamera(64, 48, 60.0, 60.0, 31.5, 23.5)


@pytest.fixture
def put_capture():
    """Write a capture of a flat wall, with clicks if there are any."""

    def put(folder, clicks=None, mirrored=False):
        frames = np.full((1, CAMERA.height, CAMERA.width), 1500, np.uint16)
        write_capture(RgbdCapture(frames, 0.001, CameraRig(CAMERA), mirrored=mirrored), folder)
        if clicks is not None:
            write_clicks(folder, Clicks(clicks))
        return folder

    return put


@pytest.fixture(scope="session")
def psi_captures(tmp_path_factory):
    """Three captures of a simulated person in psi stance, and their sequence."""
    folder = tmp_path_factory.mktemp("thesis") / "captures"
    return folder, simulate_stances(folder, ("psi",), 3, "m_tall_thin", 3, progress=no_progress)
