"""The process is killed at random moments while it stores; what it acknowledged must be there after."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from core.records import ClinicStore

_STORING = """
import sys
from pathlib import Path
import numpy as np
from core.capture.camera import PinholeCamera
from core.capture.rgbd import CameraRig, RgbdCapture
from core.records import ClinicStore, ObservationDraft, PatientDraft

folder, first_seed = Path(sys.argv[1]), int(sys.argv[2])
store = ClinicStore.open(folder)
if not store.users.count():
    store.users.create("doctor", "Doctor", "password")
if not store.patients.search():
    store.patients.create(PatientDraft("Patient"), by=1)
rig = CameraRig(PinholeCamera(64, 48, 60.0, 60.0, 31.5, 23.5))
seed = first_seed
print("ready", flush=True)
while True:
    seed += 1
    depth = np.random.default_rng(seed).integers(0, 65536, (4, 48, 64), dtype=np.uint16)
    visit = store.visits.create(1, 1)
    capture = store.captures.add(visit.id, RgbdCapture(depth, 0.001, rig, stance=str(seed)), "working", 1)
    lesion = store.lesions.create(1, visit.id, by=1)
    draft = ObservationDraft(lesion.id, visit.id, capture.id, "marked", (1.0, 2.0), (0.0, 0.0, 2.0))
    observation = store.observations.put(draft, 1)
    print(f"stored {seed} {capture.id} {observation.id}", flush=True)
"""


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="needs SIGKILL")
def test_nothing_acknowledged_is_lost(tmp_path: Path) -> None:
    root = Path(__file__).resolve().parents[3]
    env = os.environ | {"PYTHONPATH": str(root)}
    chance = random.Random(7)
    acknowledged: list[tuple[int, int, int]] = []
    for kill in range(12):
        process = subprocess.Popen(
            [sys.executable, "-c", _STORING, str(tmp_path), str(1000 * kill)],
            stdout=subprocess.PIPE,
            env=env,
            text=True,
        )
        assert process.stdout is not None
        head = ""
        if kill % 4:
            assert process.stdout.readline() == "ready\n"
            head = process.stdout.readline()  # at work: the first one is acknowledged
            time.sleep(chance.uniform(0.0, 0.25))
        else:
            time.sleep(chance.uniform(0.3, 1.5))  # also while it starts and migrates
        process.kill()
        output, _ = process.communicate()
        for line in (head + output).splitlines(keepends=True):
            if line.startswith("stored") and line.endswith("\n"):
                seed, capture, observation = (int(word) for word in line.split()[1:])
                acknowledged.append((seed, capture, observation))
    with ClinicStore.open(tmp_path) as store:
        assert store.verify() == []
        for seed, capture_id, observation_id in acknowledged:
            depth = np.random.default_rng(seed).integers(0, 65536, (4, 48, 64), dtype=np.uint16)
            assert np.array_equal(store.captures.load(capture_id).depth_frames, depth)
            assert store.observations.get(observation_id).capture_id == capture_id
        store.remove_orphans(min_age_s=-1.0)
        assert store.verify() == []
    assert len(acknowledged) >= 9
