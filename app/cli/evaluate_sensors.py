"""``geoderm evaluate sensors``: the same simulated people before several depth sensors."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Iterator, Sequence
from functools import cache as remembered
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from core.errors import InputError, WorkError

if TYPE_CHECKING:
    from app.cli.simulated_cases import SimulatedCase
    from core.evaluation import CaseName, EvaluationCase, Joints, Record, Rung
    from core.evaluation.sensor_table import SkinError
    from core.surface import BodyScan
    from devices.simulator import SimulatedCapture
    from devices.simulator.cases import SimulatedPair

METHODS = "trilateration,fused"
_LEAST_PATH_M, _FAR_OFF_M = 0.05, 0.10
_MOST_SOURCES = 12


def register(group: typer.Typer) -> None:
    """Add the command."""
    group.command("sensors")(sensors)


def sensors(
    sensor: list[str] = typer.Option([], "--sensor", help="Depth sensor; repeat it. Default: all."),
    split: str = typer.Option("test", help="test, calibration or tuning."),
    pairs: int = typer.Option(8, min=1, help="The first pairs of captures of the split."),
    methods: str = typer.Option(METHODS, help="Methods separated by commas."),
    appearance: str = typer.Option("both", help="off (geometry only), on or both."),
    cache: Path | None = typer.Option(
        None, "--cache", envvar="GEODERM_SIMULATED_CAPTURES", help="Folder that keeps simulated captures."
    ),
    out: Path | None = typer.Option(None, "--out", help="Folder for sensors.md, sensors.json and journals."),
    seed: int = typer.Option(0, min=0, help="Seed of methods and bootstrap."),
) -> None:
    """Measure accuracy with each depth sensor on the same simulated pairs of visits.

    With --out a run that was stopped goes on where it was.
    """
    from app.cli.evaluate import chosen_rungs, simulated_pairs
    from core.capture.sensors import sensor_model, sensor_names

    names = tuple(dict.fromkeys(sensor)) or sensor_names()
    for name in names:
        sensor_model(name)
    rungs = chosen_rungs(methods, "tracked", "30", appearance)
    if out is not None and not out.is_dir():
        try:
            out.mkdir(parents=True)
        except OSError as error:
            raise InputError(f"{out}: cannot be made ({error.strerror or error}).") from error
    chosen = simulated_pairs(split)[:pairs]
    document, text = measure_sensors(names, chosen, rungs, cache, out, seed=seed, split=split)
    if out is None:
        typer.echo(text)
        return
    from core.evaluation.sensor_table import write_sensors

    for path in write_sensors(document, text, out):
        typer.echo(str(path))


def measure_sensors(
    names: Sequence[str],
    pairs: Sequence[SimulatedPair],
    rungs: Sequence[Rung],
    cache: Path | None,
    out: Path | None,
    *,
    seed: int = 0,
    split: str = "test",
) -> tuple[dict[str, Any], str]:
    """Measure all rungs with all sensors, pair by pair, and return the document and the tables."""
    from app.cli.evaluate import measured_code, tell, what_was_run
    from app.cli.simulated_cases import SimulatedCases, simulator_code
    from core.capture.sensors import sensor_model
    from core.evaluation import Journal, run_ladder
    from core.evaluation.sensor_table import sensor_rows, sensors_document, sensors_markdown

    models = [sensor_model(name) for name in names]
    code = f"{measured_code()} {simulator_code()} {' '.join(m.fingerprint for m in models)} seed {seed}"
    journal = Journal(None if out is None else out / "journal.jsonl", code)
    skins = _Skins(None if out is None else out / "skins.jsonl", code)
    started = time.perf_counter()
    records: dict[str, list[Record]] = {name: [] for name in names}
    for number, pair in enumerate(pairs):
        for name in names:
            tell(number / len(pairs), f"{pair.shape}, {pair.first} to {pair.followup}, {name}")
            for case in SimulatedCases([pair], cache=cache, sensor=name).cases():
                once = _Once(case)
                records[name] += run_ladder(once, rungs, journal, seed=seed)
                skins.measure(once, name)
    bodies = len({pair.shape for pair in pairs})
    about = {
        "captures": f"simulated, {split} split, {len(pairs)} pairs of {bodies} bodies, each pair with "
        "every sensor",
        **what_was_run(rungs, started),
    }
    rows = sensor_rows(records, rungs)
    known = skins.of([record.name.case for some in records.values() for record in some])
    return sensors_document(models, rows, known, about), sensors_markdown(models, rows, known, about)


class _Once:
    """One case as a source; it is analysed once for all that is measured on it."""

    def __init__(self, case: SimulatedCase) -> None:
        self.case = case
        self._load = remembered(case.load)

    def __len__(self) -> int:
        return 1

    def cases(self) -> Iterator[_Once]:
        """Itself."""
        yield self

    @property
    def name(self) -> CaseName:
        """Which pair."""
        return self.case.name

    def load(self, joints: Joints, frames: int) -> EvaluationCase:
        """The analysed case, as the first time."""
        return self._load(joints, frames)


class _Skins:
    """What was measured of skins, in a file that a stopped run goes on with."""

    def __init__(self, path: Path | None, code: str) -> None:
        from core.evaluation.sensor_table import SkinError

        self._path, self._code = path, code
        self._known: dict[str, list[SkinError]] = {}
        if path is None or not path.exists():
            return
        for line in path.read_text(encoding="utf-8").splitlines():
            try:
                content = json.loads(line)
                skins = [
                    SkinError(**{k: tuple(v) if isinstance(v, list) else v for k, v in skin.items()})
                    for skin in content["skins"]
                ]
            except (ValueError, KeyError, TypeError) as error:
                sys.stderr.write(f"{path.name}: a line is left out ({type(error).__name__})\n")
                continue
            if content.get("code") == code:
                self._known[str(content["case"])] = skins

    def measure(self, once: _Once, sensor: str) -> None:
        """Measure both captures of a case, unless it was done."""
        key = once.name.case
        if key in self._known:
            return
        try:
            case = once.load("tracked", 30)
        except WorkError:
            self._known[key] = []
        else:
            self._known[key] = [
                skin_error(f"{key} {which}", sensor, simulated, analysed.scan)
                for which, simulated, analysed in zip(
                    ("first", "follow-up"), once.case.captures, (case.first, case.followup), strict=True
                )
            ]
        if self._path is not None:
            line = {"code": self._code, "case": key, "skins": [s.to_json() for s in self._known[key]]}
            with self._path.open("a", encoding="utf-8") as file:
                file.write(json.dumps(line) + "\n")

    def of(self, cases: Sequence[str]) -> list[SkinError]:
        """Those of some cases."""
        return [skin for case in dict.fromkeys(cases) for skin in self._known.get(case, [])]


def skin_error(case: str, sensor: str, simulated: SimulatedCapture, scan: BodyScan) -> SkinError:
    """Hold the measured skin, and shortest paths between lesions on it, against the true body.

    The true skin has the vertices of the measured one, each moved along its ray onto the body: both have the
    same rim and the same holes, and paths on them differ by the errors of depth alone.
    """
    import numpy as np

    from core.evaluation.sensor_table import SkinError
    from core.geodesics import geodesic_solver
    from devices.simulator.stage import first_hits

    truth, surface = simulated.truth, scan.surface
    rays = surface.vertices / surface.vertices[:, 2:]
    depth, normal = first_hits(truth.vertices_m, truth.triangles, rays)
    error = surface.vertices[:, 2] - depth
    on_body = np.isfinite(error) & (np.abs(error) < _FAR_OFF_M)
    normal *= -np.sign((normal * rays).sum(axis=1, keepdims=True))
    cosine = np.clip((normal * surface.normals).sum(axis=1), -1.0, 1.0)[on_body & ~surface.boundary]
    true = np.where(on_body[:, None], rays * np.where(on_body, depth, 1.0)[:, None], surface.vertices)
    rows = [k for k, name in enumerate(truth.mole_ids) if name.startswith("L") and truth.mole_visible[k]]
    places = truth.mole_points_m[rows].reshape(-1, 3)
    vertices = surface.vertices_within(places, 0.04) if len(rows) else np.zeros(0, np.int64)
    vertices = np.unique(vertices[vertices >= 0])
    vertices = vertices[on_body[vertices]][:_MOST_SOURCES]
    lengths: list[float] = []
    errors: list[float] = []
    if len(vertices) > 1:
        seen, real = (
            geodesic_solver(v, surface.triangles).distances([int(k) for k in vertices])[:, vertices]
            for v in (surface.vertices, true)
        )
        upper = np.triu_indices(len(vertices), 1)
        one, two = seen[upper], real[upper]
        good = np.isfinite(one) & np.isfinite(two) & (two > _LEAST_PATH_M)
        lengths, errors = (1000 * two[good]).tolist(), (1000 * (one - two)[good]).tolist()
    return SkinError(
        case,
        sensor,
        float(1000 * np.sqrt(np.mean(error[on_body] ** 2))),
        float(np.median(np.rad2deg(np.arccos(cosine)))),
        tuple(round(x, 3) for x in lengths),
        tuple(round(x, 3) for x in errors),
    )
