"""Damaged recordings give frames or a clear message: no hang, no crash, no process left."""

from __future__ import annotations

from pathlib import Path

import pytest

from devices.openni.runtime import runtime_folders
from tests.devices.openni.oni_mutations import LONGEST_S, MUTATIONS, mutate, play, write_original

pytestmark = pytest.mark.skipif(
    not any(list(f.glob("*OpenNI2.*")) for f in runtime_folders()),
    reason="the OpenNI2 runtime is not installed (apt-get install libopenni2-0)",
)


@pytest.fixture(scope="module")
def original(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    path = tmp_path_factory.mktemp("fuzz") / "original.oni"
    write_original(path)
    return path.read_bytes()


@pytest.mark.parametrize("damage", range(len(MUTATIONS)), ids=lambda i: MUTATIONS[i].__name__)
def test_a_damaged_recording_gives_frames_or_a_message(original: bytes, tmp_path: Path, damage: int) -> None:
    path = tmp_path / "damaged.oni"
    for round_ in range(4):
        name, data = mutate(original, damage + len(MUTATIONS) * round_)
        path.write_bytes(data)
        outcome = play(path)
        assert outcome.kind in ("refused", "message", "frames"), (name, round_)
        assert outcome.text
        assert outcome.seconds < LONGEST_S, (name, round_, outcome)
        assert not outcome.child_left


def test_the_undamaged_recording_plays(original: bytes, tmp_path: Path) -> None:
    path = tmp_path / "good.oni"
    path.write_bytes(original)
    outcome = play(path)
    assert (outcome.kind, outcome.text) == ("frames", "4 frames")
