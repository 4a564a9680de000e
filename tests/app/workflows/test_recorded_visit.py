"""An .oni file played by the real OpenNI2 runtime carries a whole first visit."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.workflows.analysis import camera_id_of_path
from app.workflows.analysis import take as take_with
from app.workflows.table import Event, State
from core.capture.rgbd import RgbdCapture
from devices.openni.cameras import write_oni
from devices.openni.runtime import runtime_folders
from devices.registry import open_device
from tests.app.workflows.conftest import Clinic, Take, seen_lesions

pytestmark = pytest.mark.skipif(
    not any(list(f.glob("*OpenNI2.*")) for f in runtime_folders()),
    reason="the OpenNI2 runtime is not installed (apt-get install libopenni2-0)",
)


def test_a_first_visit_from_recordings(clinic: Clinic, take: Take, tmp_path: Path) -> None:
    write_oni(take("psi", 1).capture, tmp_path / "psi.oni")
    write_oni(take("A", 1).capture, tmp_path / "body.oni")
    session = clinic.session()
    session.adopt_stance(session.take_stance(_play(tmp_path / "psi.oni")))
    assert session.state is State.STANCE_DONE
    session.fire(Event.GO_CAPTURE)
    session.adopt_working(session.take_working(_play(tmp_path / "body.oni")))
    session.fire(Event.GO_LESIONS)
    for pixel in seen_lesions(take("A", 1), 3).values():
        session.mark(session.snapshot.views["front"], pixel)
    session.fire(Event.GO_REVIEW)
    session.close()
    assert session.snapshot.facts().lesions == 3


def _play(path: Path) -> RgbdCapture:
    with open_device(camera_id_of_path(path)) as camera:
        return take_with(camera, view="front", stance="psi", frames=2)


@pytest.mark.parametrize(
    ("name", "camera"),
    [
        ("a.oni", "recording:a.oni"),
        ("A.ONI", "recording:A.ONI"),
        ("a.bag", "realsense-bag:a.bag"),
        ("a.db3", "realsense-bag:a.db3"),
        ("visit", "folder:visit"),
        ("visit/capture.json", "folder:visit"),
    ],
)
def test_a_file_names_the_camera_that_plays_it(name: str, camera: str) -> None:
    assert camera_id_of_path(Path(name)) == camera
