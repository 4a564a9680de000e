"""Cases for the evaluation, made by the simulated patient and the skeleton tracker.

Rendering a pair takes far longer than relocating in it, so captures can be kept in a folder, truth
beside them.
"""

from __future__ import annotations

import json
import shutil
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, replace
from functools import cached_property, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from core.capture.sensors import DEFAULT_SENSOR, sensor_model
from core.errors import InputError, WorkError

if TYPE_CHECKING:
    from core.anchors import AnalysedCapture
    from core.capture import RgbdCapture
    from core.evaluation import CaseName, EvaluationCase, Joints, PendingCase, TrueLesion, TrueSpots
    from devices.simulator import CaptureTruth, SimulatedCapture
    from devices.simulator.cases import SimulatedPair

FloatArray = NDArray[np.float64]

CLICK_ERROR_PX = 1.5
"""Standard deviation of a click on the 2560 x 1920 picture; on a smaller picture less in proportion."""

COLOR_SIZE = (2560, 1920)

SAME_SKIN_M = 0.004
"""A picture shows a place if the skin it shows at that pixel is this close to it."""

FRAMES = 30
_DONE = "pair.json"


class SimulatedCases:
    """Renders, tracks and scores pairs one at a time (`core.evaluation.CaseSource`).

    Parameters
    ----------
    pairs : sequence of SimulatedPair
    frames : int
        Depth frames that are rendered; fewer may be asked for when a case is loaded.
    cache : Path, optional
        Folder in which captures are kept. A pair in it that was made by another simulator or with other
        settings is made again.
    color_size : (width, height)
        Of the auxiliary camera.
    sensor : str
        Depth sensor, one of `core.capture.sensors.sensor_names`.
    """

    def __init__(
        self,
        pairs: Sequence[SimulatedPair],
        *,
        frames: int = FRAMES,
        cache: Path | None = None,
        color_size: tuple[int, int] = COLOR_SIZE,
        sensor: str = DEFAULT_SENSOR,
    ) -> None:
        if not pairs:
            raise InputError("An evaluation needs at least one pair.")
        sensor_model(sensor)
        if cache is not None:
            _make_folder(cache)
        self._pairs, self._frames, self._cache, self._size = tuple(pairs), frames, cache, color_size
        self._sensor = sensor

    def __len__(self) -> int:
        return len(self._pairs)

    def cases(self) -> Iterator[PendingCase]:
        """All pairs, one at a time."""
        for pair in self._pairs:
            yield SimulatedCase(pair, self._frames, self._cache, self._size, self._sensor)


class SimulatedCase:
    """One pair, rendered or read from the cache when first needed (`core.evaluation.PendingCase`)."""

    def __init__(
        self,
        pair: SimulatedPair,
        frames: int,
        cache: Path | None,
        color_size: tuple[int, int],
        sensor: str = DEFAULT_SENSOR,
    ) -> None:
        self._pair, self._frames, self._size, self._sensor = pair, frames, color_size, sensor
        self._slug = _slug(pair) + ("" if sensor == DEFAULT_SENSOR else f"-{sensor}")
        self._folder = None if cache is None else cache / f"{self._slug}-{frames}f"

    @property
    def name(self) -> CaseName:
        """Which pair; a body is a shape, whatever its skin."""
        from core.evaluation import CaseName

        pair = self._pair
        return CaseName(self._slug, pair.shape, pair.first, pair.followup)

    def load(self, joints: Joints, frames: int) -> EvaluationCase:
        """Analyse both captures. Truth reaches the analysis only with true joints."""
        from core.evaluation import EvaluationCase

        one, two = self.captures
        start = time.perf_counter()
        first, followup = (_analysed(c, joints, frames) for c in (one, two))
        seconds = time.perf_counter() - start
        return EvaluationCase(
            first=first,
            followup=followup,
            lesions=self._lesions,
            mole_ids=two.truth.mole_ids,
            moles_m=two.truth.mole_points_m,
            first_joints_m=one.truth.joints_m,
            followup_joints_m=two.truth.joints_m,
            spots=_true_spots(one.truth, two.truth),
            analysis_seconds=seconds,
        )

    @cached_property
    def captures(self) -> tuple[SimulatedCapture, SimulatedCapture]:
        """First visit and follow-up, with their truth."""
        if self._folder is None:
            return _render(self._pair, self._frames, self._size, self._sensor)
        made_by = json.loads(
            json.dumps(
                {
                    **asdict(self._pair),
                    "frames": self._frames,
                    "color_size": self._size,
                    "sensor": sensor_model(self._sensor).fingerprint,
                    "simulator": simulator_code(),
                }
            )
        )
        if _read_done(self._folder) != made_by:
            if self._folder.exists():
                shutil.rmtree(self._folder)
            made = _render(self._pair, self._frames, self._size, self._sensor)
            _write(made, self._folder, made_by)
        return _read(self._folder / "first"), _read(self._folder / "followup")

    @cached_property
    def _lesions(self) -> tuple[TrueLesion, ...]:
        """Lesions that the first capture shows, clicked with an error, and where they truly are.

        Moles that vanish in between are healed sites beside the lesions that heal and leave a scar.
        """
        from core.evaluation import TrueLesion

        one, two = (capture.truth for capture in self.captures)
        rng = np.random.default_rng(self._pair.seed)
        out = []
        for i, name in enumerate(one.mole_ids):
            click = one.mole_pixels[i] + rng.normal(0.0, CLICK_ERROR_PX * self._size[0] / COLOR_SIZE[0], 2)
            gone = name not in two.mole_row
            healed = gone or name in two.healed_ids
            if not one.mole_visible[i] or not (healed or name.startswith("L")):
                continue
            place = two.position(one.mole_triangle[i], one.mole_barycentric[i])
            pixel = two.rig.project_to_picture(place)[0]
            visible = _shows(two, place) if gone else bool(two.mole_visible[two.mole_row[name]])
            out.append(
                TrueLesion(
                    id=name,
                    pixel=(float(click[0]), float(click[1])),
                    first_m=one.mole_points_m[i],
                    followup_m=place,
                    followup_pixel=(float(pixel[0]), float(pixel[1])),
                    visible=visible,
                    healed=healed,
                )
            )
        return tuple(out)


def _true_spots(one: CaptureTruth, two: CaptureTruth) -> TrueSpots:
    """Moles of one visit only that are seen in it, on skin that the other visit shows as well."""
    from core.evaluation import TrueSpots

    def only_in(here: CaptureTruth, there: CaptureTruth) -> FloatArray:
        rows = [
            k
            for k, name in enumerate(here.mole_ids)
            if name not in there.mole_row
            and here.mole_visible[k]
            and _shows(there, there.position(here.mole_triangle[k], here.mole_barycentric[k]))
        ]
        return here.mole_points_m[rows].reshape(-1, 3)

    return TrueSpots(new_m=only_in(two, one), vanished_m=only_in(one, two))


def _shows(truth: CaptureTruth, place_m: FloatArray) -> bool:
    """Whether the picture shows this place of the skin, and the depth camera is not far from doing so."""
    pixel = truth.rig.project_to_picture(place_m)[0]
    seen = truth.surface_point_at(pixel) if np.isfinite(pixel).all() else None
    return seen is not None and float(np.linalg.norm(seen.position_m - place_m)) < SAME_SKIN_M


def _analysed(simulated: SimulatedCapture, joints: Joints, frames: int) -> AnalysedCapture:
    from core.anchors import analyse_capture
    from devices.trackers import default_tracker

    truth = dict(simulated.truth.joints_m) if joints == "true" else None
    capture = some_frames(simulated.capture, frames).with_joints(truth)
    return analyse_capture(capture, default_tracker(), use_recorded=joints == "true")


def some_frames(capture: RgbdCapture, count: int) -> RgbdCapture:
    """The capture with ``count`` frames from its middle; 0 or more than there are: all of them."""
    total = len(capture.depth_frames)
    if count == 0 or count >= total:
        return capture
    start = (total - count) // 2
    return replace(capture, depth_frames=capture.depth_frames[start : start + count])


def _render(
    pair: SimulatedPair, frames: int, color_size: tuple[int, int], sensor: str
) -> tuple[SimulatedCapture, SimulatedCapture]:
    from devices.simulator import make_rig
    from devices.simulator.cases import make_pair

    _, first, followup = make_pair(pair, frames, make_rig(color_size, sensor=sensor))
    return first, followup


def _slug(pair: SimulatedPair) -> str:
    return f"{pair.seed}-{pair.shape}-{pair.first}-{pair.followup}-{pair.view}"


@lru_cache(maxsize=1)
def simulator_code() -> str:
    """Fingerprint of the program that renders, as it was when first asked for."""
    import devices.simulator
    from core.evaluation import code_fingerprint

    return code_fingerprint([Path(devices.simulator.__file__).parent])


def _make_folder(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"{folder}: cannot be made ({error.strerror or error}).", "Choose another."
        ) from error


def _read_done(folder: Path) -> Any:
    try:
        return json.loads((folder / _DONE).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None


def _write(pair: tuple[SimulatedCapture, SimulatedCapture], folder: Path, made_by: dict[str, Any]) -> None:
    from devices.simulator import write_simulated

    try:
        folder.mkdir(parents=True)
        for capture, name in zip(pair, ("first", "followup"), strict=True):
            write_simulated(capture, folder / name)
        # Written last: a pair without it was not finished.
        (folder / _DONE).write_text(json.dumps(made_by, indent=1), encoding="utf-8")
    except OSError as error:
        raise WorkError(f"{folder}: cannot be written ({error.strerror or error}).") from error


def _read(folder: Path) -> SimulatedCapture:
    from core.capture import read_capture
    from devices.simulator import SimulatedCapture, read_truth

    capture = read_capture(folder)
    return SimulatedCapture(capture, read_truth(folder, capture.rig))
