"""The simulated patient behind the interface of every depth camera."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from core.calibration.profile import CalibrationProfile, DepthCorrection
from core.capture.rgbd import CameraRig
from core.errors import Cancelled, InputError, WorkError
from devices.camera import DepthCamera
from devices.registry import list_devices, open_device
from devices.simulator import SHAPES, SimulatedCamera, SimulatedPatient, SimulatedScene
from devices.simulator.live_process import DRAWING


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


def test_an_option_it_does_not_have_is_named_with_those_it_has() -> None:
    with pytest.raises(InputError, match=r"no option 'colour'.*sway"):
        open_device("simulator:child10?colour=red")


@pytest.mark.parametrize("options", ["sway=drunk", "light=0", "fault=fire@3", "fault=stall@soon"])
def test_impossible_training_options_are_refused(options: str) -> None:
    with pytest.raises(InputError):
        open_device(f"simulator:child10?{options}")


def test_a_dark_room_makes_dark_pictures_as_far_as_the_exposure_cannot_help(dummy: SimulatedPatient) -> None:
    def brightness(camera: SimulatedCamera) -> float:
        color = camera.capture(frames=1).color
        assert color is not None
        return float(color.mean())

    with SimulatedCamera(dummy, light=0.7) as dim:
        usual = brightness(dim)  # automatic exposure makes up for it
        dim.set_control("exposure_s", 0.005)
        assert {c.name: c.value for c in dim.controls()} == {"auto_exposure": 0.0, "exposure_s": 0.005}
        assert brightness(dim) < 0.6 * usual
        with pytest.raises(InputError, match="exposure_s goes from"):
            dim.set_control("exposure_s", 3.0)
        with pytest.raises(InputError, match="no control"):
            dim.set_control("zoom", 2.0)


def test_a_calibration_of_its_serial_numbers_goes_into_the_capture(dummy: SimulatedPatient) -> None:
    with SimulatedCamera(dummy) as camera:
        who, rig = camera.identity, camera.rig
        moved = replace(rig.depth, fx=580.0)
        profile = CalibrationProfile(
            CameraRig(moved, rig.color, rig.color_from_depth),
            who.depth_serial,
            who.color_serial,
            DepthCorrection(scale=1.01),
        )
        before = DRAWING.pid
        plain = camera.capture(frames=1)
        assert plain.calibration is None
        assert plain.sensor == who.sensor == "kinect-v1"
        assert DRAWING.pid == before  # nobody has looked: no other process is needed
        camera.use_profile(profile)
        assert camera.rig.depth.fx == 580.0
        capture = camera.capture(frames=1)
        assert capture.rig.depth.fx == 580.0
        assert capture.rig.color is not None
        assert capture.rig.color.width == 320
        assert capture.calibration == profile.document()
        there = plain.depth_frames > 0
        ratio = capture.depth_frames[there] / plain.depth_frames[there]
        assert float(np.median(ratio)) == pytest.approx(1.01, abs=1e-3)
        with pytest.raises(InputError, match="belongs to other"):
            camera.use_profile(replace(profile, depth_serial="other"))
        small = replace(moved, width=320, height=240)
        with pytest.raises(InputError, match="other image sizes"):
            camera.use_profile(replace(profile, rig=CameraRig(small, rig.color, rig.color_from_depth)))
        camera.use_profile(None)
        assert camera.profile is None


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
