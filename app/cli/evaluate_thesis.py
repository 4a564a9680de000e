"""``geoderm evaluate thesis``: the thesis's own experiments, on simulated captures or on real ones."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from core.errors import InputError

if TYPE_CHECKING:
    from core.capture import RgbdCapture
    from core.evaluation.thesis import Clicks, StanceSequence
    from core.progress import Progress
    from devices.simulator import SimulatedPatient

CLICK_ERROR_PX = 1.0
"""Standard deviation of a simulated click on the 1280 x 960 picture: 2 mm at 2.3 m."""

_COLOR_SIZE = (1280, 960)
_FORMAT = "geoderm-thesis-simulation/1"


def register(group: typer.Typer) -> None:
    """Add the command to the group of ``geoderm evaluate``."""
    group.command("thesis")(thesis)


def thesis(
    out: Path = typer.Option(..., "--out", help="Folder for pictures, results.json and report.md."),
    captures: Path | None = typer.Option(
        None,
        "--captures",
        help="Folder of successive captures of one stance, or of such folders. Default: simulated.",
    ),
    wall: Path | None = typer.Option(
        None, "--wall", help="Capture folder of a bare wall for figure 8. Default: rendered."
    ),
    figures: str = typer.Option(
        "",
        "--figures",
        help="Of 8, 9, 10, 11, table2, cpu, stances, time, separated by commas. Default: all.",
    ),
    cache: Path | None = typer.Option(
        None, "--cache", help="Folder that keeps simulated captures. Default: OUT/captures."
    ),
    stances: str = typer.Option(
        "psi,A", "--stances", help="Stances to simulate; table 2 is about the first two."
    ),
    count: int = typer.Option(30, "--count", min=2, max=1000, help="Captures of each stance."),
    body: str = typer.Option("m_tall_thin", "--body", help="Body of the simulated patient."),
    surface: str = typer.Option("raw", "--surface", help="raw (the thesis) or smoothed (the application's)."),
    beside: str = typer.Option(
        "trilateration",
        "--beside",
        help="Further relocation methods to measure, separated by commas, or none.",
    ),
    delta_m: float | None = typer.Option(
        None, "--delta-m", help="Half width of a voting band in metres. Default: 0.03 (docs/method.md)."
    ),
    seed: int = typer.Option(0, "--seed", min=0, help="Seed of the simulation and of every random draw."),
) -> None:
    """Repeat the thesis's experiments: paths, joint histograms, variances, errors, table 2, CPU time."""
    from core.capture import read_capture
    from core.evaluation.thesis import FIGURES, Protocol, Wall, find_sequences, run_thesis, write_results
    from core.progress import ScaledProgress
    from core.relocation import DEFAULT_DELTA_M, RelocationOptions, relocation_method
    from devices.trackers import default_tracker

    wanted = _names(figures)
    for name in wanted:
        if name not in FIGURES:
            raise InputError(f"There is no figure '{name}'.", f"Choose from: {', '.join(FIGURES)}.")
    if surface not in ("raw", "smoothed"):
        raise InputError(f"There is no '{surface}' surface.", "Choose raw or smoothed.")
    methods = () if beside == "none" else _names(beside)
    for name in methods:
        relocation_method(name)
    options = RelocationOptions(
        delta_m=DEFAULT_DELTA_M if delta_m is None else delta_m, check_visibility=False
    )
    protocol = Protocol("smoothed" if surface == "smoothed" else "raw", methods, options, seed)
    plane: Wall | None = None
    if not wanted or "8" in wanted:
        plane = (
            Wall(simulated_wall(seed), "rendered with the simulator's sensor noise")
            if wall is None
            else Wall(read_capture(wall), "recorded")
        )
    share = 0.0
    sequences: tuple[StanceSequence, ...] = ()
    if captures is not None:
        sequences = tuple(s.shortened(count) for s in find_sequences(captures))
    _make_folder(out)
    if captures is None and (not wanted or set(wanted) - {"cpu"}):
        share = 0.3
        only_paths = bool(wanted) and not set(wanted) - {"8", "cpu"}
        folder = out / "captures" if cache is None else cache
        names = _names(stances)[: 1 if only_paths else None]
        sequences = simulate_stances(
            folder,
            names,
            2 if only_paths else count,
            body,
            seed,
            progress=ScaledProgress(_tell, 0.0, share),
        )
    results = run_thesis(
        sequences,
        default_tracker(),
        plane,
        out,
        figures=wanted or None,
        protocol=protocol,
        progress=ScaledProgress(_tell, share, 1.0),
    )
    numbers, page = write_results(results, out)
    typer.echo(page.read_text(encoding="utf-8"))
    typer.echo(f"Written to {out}: {numbers.name}, {page.name}, pictures: {len(results.pictures)}")


def _names(text: str) -> tuple[str, ...]:
    return tuple(dict.fromkeys(name.strip() for name in text.split(",") if name.strip()))


def _make_folder(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot be made a folder ({error.strerror or error}).") from error


_told = ""


def _tell(fraction: float, message: str = "") -> None:
    """One line on standard error for every new message."""
    global _told
    if message and message != _told:
        _told = message
        sys.stderr.write(f"{100 * fraction:3.0f} %  {message}\n")


def simulate_stances(
    folder: Path,
    stances: tuple[str, ...],
    count: int,
    body: str,
    seed: int,
    *,
    progress: Progress,
) -> tuple[StanceSequence, ...]:
    """Successive single-frame captures of one simulated person holding each stance, kept in ``folder``.

    A capture that is there already is not rendered again, so that a stopped run goes on where it was.

    Raises
    ------
    InputError
        If the folder holds captures of another simulation, or a stance or body does not exist.
    """
    from core.capture import write_capture
    from core.evaluation.thesis import CLICKS_FILE, StanceSequence, write_clicks
    from devices.simulator import STANCES

    if not stances:
        raise InputError("No stance was named.", f"Choose from: {', '.join(STANCES)}.")
    for name in stances:
        if name not in STANCES:
            raise InputError(f"There is no stance '{name}'.", f"Choose from: {', '.join(STANCES)}.")
    patient = held_patient(body, seed)
    _claim(folder, body, seed)
    out = []
    for k, stance in enumerate(stances):
        folders = [folder / stance / f"{number:03d}" for number in range(count)]
        place: tuple[float, float] | None = None
        for number, path in enumerate(folders):
            progress((k + number / count) / len(stances), f"Rendering {stance} {path.name}")
            if (path / CLICKS_FILE).exists():
                continue
            place = place or _camera_place(patient, stance)
            capture, clicks = _held_capture(patient, stance, number, place)
            write_capture(capture, path)
            write_clicks(path, clicks)
        out.append(StanceSequence(stance, tuple(folders)))
    return tuple(out)


def _claim(folder: Path, body: str, seed: int) -> None:
    """Mark the folder as this simulation's; refuse one that holds another's captures."""
    path = folder / "simulation.json"
    mine = {"format": _FORMAT, "body": body, "seed": seed, "color_size": list(_COLOR_SIZE)}
    if path.exists():
        try:
            found = json.loads(path.read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise InputError(
                f"{path}: cannot be read ({error}).", "Choose another --cache folder."
            ) from error
        if found != mine:
            raise InputError(
                f"{path}: the folder keeps captures of another simulation.", "Choose another --cache folder."
            )
        return
    _make_folder(folder)
    if any(not p.name.startswith(".") for p in folder.iterdir()):
        raise InputError(f"{folder}: is not empty and holds no simulation.", "Choose another --cache folder.")
    path.write_text(json.dumps(mine, indent=1), encoding="utf-8")


def held_patient(body: str, seed: int) -> SimulatedPatient:
    """One person who holds a stance while captures follow each other.

    The simulator's usual variation is that of a person who takes a stance anew; between successive captures
    of one stance limbs move by about a degree.
    """
    from devices.simulator import SimulatedPatient, Variation, make_rig

    variation = Variation(jitter_deg=1.0, twist_deg=2.0, breath_m=0.004, sway_m=0.003)
    return SimulatedPatient(body, 700 + seed, 180, lesions=24, variation=variation, rig=make_rig(_COLOR_SIZE))


def _camera_place(patient: SimulatedPatient, stance: str) -> tuple[float, float]:
    """Distance and height of a camera that sees the whole person through all captures of a stance."""
    from devices.simulator.recording import framing_distance

    standing = patient.posed(stance, 1, 0).vertices
    height = 0.5 * float(standing[:, 2].max())
    return framing_distance(standing, patient.rig, patient.room, height) + 0.05, height


def _held_capture(
    patient: SimulatedPatient, stance: str, number: int, place: tuple[float, float]
) -> tuple[RgbdCapture, Clicks]:
    """One capture of the held stance, and the clicks on its lesions."""
    import numpy as np

    from core.evaluation.thesis import Clicks

    rng = np.random.default_rng((patient.seed, number, *stance.encode()))
    shift, turn = rng.normal(0.0, 0.01), rng.normal(0.0, 1.5)
    simulated = patient.capture(
        stance,
        frames=1,
        seed=int(rng.integers(1, 2**31)),
        distance_m=place[0] + float(shift),
        turn_deg=float(turn),
        height_m=place[1],
    )
    truth = simulated.truth
    camera = simulated.capture.rig.picture_camera
    lesions = {}
    for name in truth.lesion_ids:
        row = truth.mole_row[name]
        pixel = truth.mole_pixels[row] + rng.normal(0.0, CLICK_ERROR_PX, 2)
        if truth.mole_visible[row] and camera.contains(pixel)[0]:
            lesions[name] = (float(pixel[0]), float(pixel[1]))
    return simulated.capture, Clicks(lesions, simulated=True)


def simulated_wall(seed: int, distance_m: float = 1.6, yaw_deg: float = 12.0) -> RgbdCapture:
    """One raw depth frame of a bare wall as the simulated Kinect sees it; there is no colour."""
    import numpy as np

    from core.capture import CameraRig, RgbdCapture
    from core.capture.sensors import sensor_model
    from devices.simulator.sensor import DEPTH_UNIT_M, FrameMaker, SensorView

    sensor = sensor_model("kinect-v1")
    camera = sensor.depth_camera
    normal = np.array([np.sin(np.deg2rad(yaw_deg)), 0.0, np.cos(np.deg2rad(yaw_deg))])
    rays = camera.pixel_rays
    depth = (distance_m * normal[2] / (rays @ normal)).astype(np.float32)
    cosine = ((rays @ normal) / np.linalg.norm(rays, axis=2)).astype(np.float32)
    view = SensorView(depth, cosine, np.zeros(depth.shape, np.bool_))
    frame = FrameMaker(sensor, view, 0, np.random.default_rng((9, seed))).frame(depth)
    return RgbdCapture(frame[None], DEPTH_UNIT_M, CameraRig(camera), view="wall", sensor=sensor.name)
