"""The simulated patient behind the interface of every depth camera."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

from core.errors import Cancelled, InputError, WorkError
from devices.camera import DepthCamera
from devices.registry import list_devices, open_device
from devices.simulator import SHAPES, SimulatedCamera, SimulatedPatient, SimulatedScene


def test_it_is_a_depth_camera(dummy: SimulatedPatient) -> None:
    camera = SimulatedCamera(dummy)
    assert isinstance(camera, DepthCamera)
    assert camera.info.kind == "simulator"
    assert camera.info.live


def test_the_registry_lists_every_shape_and_opens_it() -> None:
    ids = [info.id for info in list_devices("simulator")]
    assert ids == [f"simulator:{shape}" for shape in SHAPES]
    with open_device(
        "simulator:child10?seed=4&stance=A&view=back&visit=2&turn_deg=-5&distance_m=2.1"
    ) as camera:
        assert isinstance(camera, SimulatedCamera)
        assert camera.scene == SimulatedScene("A", "back", 2, -5.0, 2.1)
        assert camera.patient.seed == 4


@pytest.mark.parametrize(
    "device_id", ["simulator:giant", "simulator:child10?colour=red", "simulator:child10?visit=two"]
)
def test_impossible_simulated_cameras_are_refused(device_id: str) -> None:
    with pytest.raises(InputError):
        open_device(device_id)


def test_it_takes_what_the_scene_says_and_keeps_the_truth(dummy: SimulatedPatient) -> None:
    with SimulatedCamera(dummy) as camera:
        camera.stand(stance="T", view="back", visit=2)
        capture = camera.capture(frames=2)
        assert (capture.stance, capture.view, len(capture.depth_frames)) == ("T", "back", 2)
        assert capture.joints_m is None
        assert camera.last is not None
        assert camera.last.capture is capture


def test_a_closed_camera_says_so(dummy: SimulatedPatient) -> None:
    camera = SimulatedCamera(dummy)
    assert camera.preview() is None
    with pytest.raises(WorkError, match="closed"):
        camera.capture(1)


def test_the_preview_is_small_moves_and_follows_the_scene(dummy: SimulatedPatient) -> None:
    with SimulatedCamera(dummy) as camera:
        one, two = camera.preview(), camera.preview()
        assert one is not None
        assert two is not None
        assert one.rgb is not None
        assert two.rgb is not None
        assert one.rgb.shape == (240, 320, 3)
        assert (one.rgb != two.rgb).any()
        camera.stand(stance="down")
        three = camera.preview()
        assert three is not None
        assert three.rgb is not None
        still = np.abs(one.rgb.astype(int) - two.rgb).mean()
        assert np.abs(one.rgb.astype(int) - three.rgb).mean() > 1.5 * still


def test_a_capture_can_be_cancelled(dummy: SimulatedPatient) -> None:
    def stop(fraction: float, message: str = "") -> None:
        if fraction > 0.2:
            raise Cancelled

    with SimulatedCamera(dummy) as camera, pytest.raises(Cancelled):
        camera.capture(frames=30, progress=stop)


def test_listing_simulated_cameras_loads_no_renderer() -> None:
    code = (
        "import sys; from devices.registry import list_devices; list_devices('simulator');"
        "sys.exit('open3d' in sys.modules or 'scipy' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
