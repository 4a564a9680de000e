"""``geoderm evaluate``: accuracy, on simulated patients or on captures with clicked truth."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Iterable, Sequence
from datetime import UTC, datetime
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import typer

from core.errors import InputError

if TYPE_CHECKING:
    from core.evaluation import CaseSource, Joints, Journal, Record, Rung
    from core.relocation import RelocationOptions
    from devices.simulator.cases import SimulatedPair

CACHE_VARIABLE = "GEODERM_SIMULATED_CAPTURES"
"""Environment variable naming the folder in which simulated captures are kept."""

JOURNAL = "journal.jsonl"
_Value = TypeVar("_Value")


def register(app: typer.Typer) -> None:
    """Add the command group."""
    from app.cli import evaluate_calibrate, evaluate_hand, evaluate_sensors, evaluate_thesis

    group = typer.Typer(help="Measure accuracy.", no_args_is_help=True, pretty_exceptions_enable=False)
    group.callback()(_group)
    group.command("ladder")(ladder)
    group.command("captures")(captures)
    group.command("residuals")(residuals)
    evaluate_calibrate.register(group)
    evaluate_sensors.register(group)
    evaluate_thesis.register(group)
    evaluate_hand.register(group)
    app.add_typer(group, name="evaluate")


def _group() -> None:
    """Measure accuracy."""


_SPLIT = typer.Option("test", help="test, calibration, or tuning: the bodies that parameters were chosen on.")
_PAIRS = typer.Option(0, min=0, help="The first pairs of captures of the split; 0 for all.")
_METHODS = typer.Option("", help="Methods separated by commas. Default: every method there is.")
_JOINTS = typer.Option("tracked", help="tracked, true or both; true ones are labelled so.")
_FRAMES = typer.Option("30", help="Depth frames of a capture: 1, 30, or several separated by commas.")
_APPEARANCE = typer.Option("both", help="off (geometry only), on or both: whether colour may be matched.")
_CACHE = typer.Option(
    None, "--cache", envvar=CACHE_VARIABLE, help="Folder that keeps simulated captures for the next run."
)
_OUT = typer.Option(
    None, "--out", help="Folder for ladder.json, report.md, pictures and the journal of measurements."
)
_DELTA = typer.Option(
    None, "--delta-m", help="Half width of a voting band in metres. Default: 0.03 (docs/method.md)."
)
_SEED = typer.Option(0, min=0, help="Seed of methods and bootstrap.")
_SENSOR = typer.Option("kinect-v1", "--sensor", help="Depth sensor of the simulated captures.")
_KEEP = typer.Option(
    False, "--keep", help="Take over measurements of an earlier version of the program as well."
)


def ladder(
    split: str = _SPLIT,
    pairs: int = _PAIRS,
    methods: str = _METHODS,
    joints: str = _JOINTS,
    frames: str = _FRAMES,
    appearance: str = _APPEARANCE,
    cache: Path | None = _CACHE,
    out: Path | None = _OUT,
    delta_m: float | None = _DELTA,
    seed: int = _SEED,
    sensor: str = _SENSOR,
    keep: bool = _KEEP,
) -> None:
    """Measure methods on simulated pairs of visits.

    With --out a run that was stopped goes on where it was.
    """
    from app.cli.simulated_cases import simulator_code
    from core.capture.sensors import sensor_model

    rungs = chosen_rungs(methods, joints, frames, appearance)
    chosen = simulated_pairs(split)[: pairs or None]
    source = _simulated(chosen, rungs, cache, sensor)
    about = {
        "captures": f"simulated, {sensor}, {split} split, "
        f"{len(chosen)} pairs of {len({p.shape for p in chosen})} bodies"
    }
    captures_code = f"{simulator_code()} {sensor_model(sensor).fingerprint}"
    _run(source, rungs, about, out, _options(delta_m), seed, keep, captures_code)


def captures(
    manifest: Path = typer.Argument(
        ..., help="CSV file: case, first, followup, lesions, truth, and optionally body."
    ),
    methods: str = _METHODS,
    joints: str = typer.Option("tracked", help="tracked, true (the captures' own joints_m) or both."),
    frames: str = typer.Option("0", help="Depth frames of a capture, separated by commas; 0 for all."),
    appearance: str = _APPEARANCE,
    out: Path | None = _OUT,
    delta_m: float | None = _DELTA,
    seed: int = _SEED,
    keep: bool = _KEEP,
) -> None:
    """Measure methods on your own pairs of captures, whose true places somebody has clicked.

    The file named in column "truth" says where the lesions are in the follow-up: {"lesions": [{"id": "L1",
    "pixel": [u, v]}, {"id": "L2", "point_m": [x, y, z]}, {"id": "L3", "visible": false}]}. A clicked pixel
    stands for the place that the sensor gives there: errors are then beside the sensor floor.
    """
    from app.cli.captured_cases import CapturedCases
    from core.evaluation.manifest import read_manifest

    rungs = chosen_rungs(methods, joints, frames, appearance)
    pairs = read_manifest(manifest)
    about = {"captures": f"{manifest.name}, {len(pairs)} pairs of {len({p.body for p in pairs})} bodies"}
    _run(CapturedCases(pairs), rungs, about, out, _options(delta_m), seed, keep)


def residuals(
    out: Path = typer.Option(..., "--out", help="CSV file to write: one row per lesion and method."),
    split: str = typer.Option("calibration", help="calibration, tuning or test."),
    pairs: int = _PAIRS,
    methods: str = _METHODS,
    joints: str = _JOINTS,
    frames: str = _FRAMES,
    appearance: str = _APPEARANCE,
    cache: Path | None = _CACHE,
    seed: int = _SEED,
    sensor: str = _SENSOR,
    keep: bool = _KEEP,
) -> None:
    """Write the error and the stated region of every lesion: raw material for calibration.

    Measurements are kept beside the file (.jsonl); a run that was stopped goes on where it was.
    """
    from app.cli.simulated_cases import simulator_code
    from core.capture.sensors import sensor_model
    from core.evaluation import run_ladder, write_residuals

    if not out.parent.is_dir():
        raise InputError(f"{out}: the folder does not exist.", "Create it or choose another.")
    rungs = chosen_rungs(methods, joints, frames, appearance)
    source = _simulated(simulated_pairs(split)[: pairs or None], rungs, cache, sensor)
    code = f"{measured_code()} {simulator_code()} {sensor_model(sensor).fingerprint} seed {seed}"
    journal = _journal(out.with_suffix(".jsonl"), code, keep)
    records = run_ladder(source, rungs, journal, seed=seed, progress=tell)
    typer.echo(f"{out}: {write_residuals(records, out)} rows")


def simulated_pairs(split: str) -> tuple[SimulatedPair, ...]:
    """The frozen pairs of a split.

    Raises
    ------
    InputError
        If there is no such split.
    """
    from devices.simulator.cases import CALIBRATION_PAIRS, TEST_PAIRS, TUNING_PAIRS

    splits = {"test": TEST_PAIRS, "calibration": CALIBRATION_PAIRS, "tuning": TUNING_PAIRS}
    if split not in splits:
        raise InputError(f"There is no split '{split}'.", f"Choose one of: {', '.join(splits)}.")
    return tuple(splits[split])


def _simulated(
    pairs: Sequence[SimulatedPair], rungs: Sequence[Rung], cache: Path | None, sensor: str = "kinect-v1"
) -> CaseSource:
    from app.cli.simulated_cases import FRAMES, SimulatedCases

    most = max(rung.frames for rung in rungs)
    if most > FRAMES:
        raise InputError(f"--frames: simulated captures have {FRAMES} depth frames, not {most}.")
    return SimulatedCases(pairs, cache=cache, sensor=sensor)


def chosen_rungs(methods: str, joints: str, frames: str, appearance: str) -> tuple[Rung, ...]:
    """What is to be measured, from the options."""
    from core.evaluation import check_methods, ladder_methods, ladder_rungs

    kinds: dict[str, tuple[Joints, ...]] = {
        "tracked": ("tracked",),
        "true": ("true",),
        "both": ("tracked", "true"),
    }
    colors = {"off": (False,), "on": (True,), "both": (False, True)}
    counts = []
    for word in _words(frames):
        if not word.isdecimal() or int(word) > 1000:
            raise InputError(f"--frames: '{word}' is no number of frames from 0 to 1000.")
        counts.append(int(word))
    if not counts:
        raise InputError("--frames: no number of frames is given.")
    return ladder_rungs(
        check_methods(_words(methods)) or ladder_methods(),
        joints=_choice("--joints", joints, kinds),
        frames=counts,
        appearance=_choice("--appearance", appearance, colors),
    )


def _words(text: str) -> tuple[str, ...]:
    return tuple(dict.fromkeys(word.strip() for word in text.split(",") if word.strip()))


def _choice(option: str, word: str, known: dict[str, _Value]) -> _Value:
    if word not in known:
        raise InputError(f"{option}: there is no '{word}'.", f"Choose one of: {', '.join(known)}.")
    return known[word]


def _options(delta_m: float | None) -> RelocationOptions:
    from core.relocation import DEFAULT_DELTA_M, RelocationOptions

    return RelocationOptions(delta_m=DEFAULT_DELTA_M if delta_m is None else delta_m)


def _journal(path: Path | None, code: str, keep: bool) -> Journal:
    """The measurements so far; those of another program or other settings are told apart by ``code``."""
    from core.evaluation import Journal

    journal = Journal(path, code, any_code=keep)
    if len(journal):
        sys.stderr.write(f"{len(journal)} measurements are taken over from {path}\n")
    if journal.outdated:
        sys.stderr.write(
            f"{journal.outdated} measurements of another program or other settings are made again\n"
        )
    return journal


@lru_cache(maxsize=1)
def measured_code() -> str:
    """Fingerprint of everything that a measurement depends on."""
    import core
    import devices.trackers
    from core.evaluation import code_fingerprint

    root = Path(core.__file__).parent
    rooms = ("capture", "surface", "lesions", "geodesics", "anchors", "relocation")
    trackers = Path(devices.trackers.__file__).parent
    evaluation = [root / "evaluation" / f"{name}.py" for name in ("scores", "parts", "library_baselines")]
    return code_fingerprint([*(root / room for room in rooms), *evaluation, trackers])


def _run(
    source: CaseSource,
    rungs: Sequence[Rung],
    about: dict[str, str],
    out: Path | None,
    options: RelocationOptions,
    seed: int,
    keep: bool,
    captures_code: str = "",
) -> None:
    """Measure, print the tables, write the report."""
    from core.evaluation import make_report, markdown, run_ladder

    if out is not None:
        try:
            out.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"{out}: cannot be made ({error.strerror or error}).") from error
    code = f"{measured_code()} {captures_code} seed {seed} delta {options.delta_m:g}"
    journal = _journal(None if out is None else out / JOURNAL, code, keep)
    started = time.perf_counter()
    records = run_ladder(source, rungs, journal, options=options, seed=seed, progress=tell)
    about = {**about, **what_was_run(rungs, started)}
    if out is None:
        typer.echo(markdown(make_report(records, rungs, about=about, method=best_method(rungs), seed=seed)))
    else:
        for path in write_all(records, rungs, about, out, seed):
            typer.echo(str(path))


def best_method(rungs: Iterable[Rung]) -> str:
    """The application's default, or the last method where that is not measured."""
    from core.evaluation import FLOOR
    from core.relocation import DEFAULT_METHOD

    methods = [rung.method for rung in rungs if rung.method != FLOOR]
    return DEFAULT_METHOD if DEFAULT_METHOD in methods else methods[-1]


def what_was_run(rungs: Sequence[Rung], started: float) -> dict[str, str]:
    """Conditions, program and time, for the head of a report."""
    conditions = dict.fromkeys(rung.conditions for rung in rungs)
    methods = dict.fromkeys(rung.label for rung in rungs)
    return {
        "conditions": "; ".join(conditions),
        "rows": ", ".join(methods),
        "measured": f"{datetime.now(UTC):%Y-%m-%d %H:%M} UTC on {os.cpu_count()} cores, "
        f"this run {(time.perf_counter() - started) / 60:.0f} min",
        "program": measured_code(),
    }


def write_all(
    records: Sequence[Record], rungs: Sequence[Rung], about: dict[str, str], out: Path, seed: int = 0
) -> list[Path]:
    """Write the report with its pictures and return the files."""
    from core.evaluation import make_report, write_report
    from core.evaluation.plots import draw_plots

    method = best_method(rungs)
    report = make_report(records, rungs, about=about, method=method, seed=seed)
    pictures = draw_plots(report, records, rungs, method, out)
    write_report(report, out, pictures=pictures)
    return [out / name for name in ("report.md", "ladder.json", *pictures)]


def tell(fraction: float, message: str = "") -> None:
    """One line of progress on standard error."""
    sys.stderr.write(f"{100 * fraction:3.0f} %  {message}\n")
