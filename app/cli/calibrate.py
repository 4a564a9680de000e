"""``geoderm calibrate``: print the board, calibrate a rig, check it, and see which profiles there are."""

from __future__ import annotations

import contextlib
import json
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from app.cli.calibration_words import check_report, check_text, profile_text, result_report, result_text

if TYPE_CHECKING:
    from core.calibration.board import BoardSpec
    from core.calibration.daily_check import CheckResult
    from core.calibration.profile import CalibrationProfile, ProfileStore
    from devices.live import LiveCamera

_PROFILES = typer.Option(None, "--profiles", help="Folder of the profiles; by default this workstation's.")
_SQUARE = typer.Option(None, "--square-mm", min=5.0, max=500.0, help="Side of one square as measured.")
_PAPER = typer.Option("A3", "--paper", help="Paper of the board: A4 or A3.")
_JSON = typer.Option(False, "--json", help="Print JSON.")


def register(app: typer.Typer) -> None:
    """Add the command."""
    group = typer.Typer(
        help="Calibrate a rig with a printed board.", no_args_is_help=True, rich_markup_mode=None
    )
    group.command("board")(board)
    group.command("run")(run)
    group.command("check")(check)
    group.command("list")(list_profiles)
    group.command("show")(show)
    app.add_typer(group, name="calibrate")


def board(
    out: Path = typer.Argument(..., help="PDF to write."),
    paper: str = _PAPER,
) -> None:
    """Write the calibration board as a PDF at exact scale."""
    from core.calibration.board_pdf import board_pdf
    from core.errors import InputError, WorkError

    data = board_pdf(paper)
    if not out.parent.is_dir():
        raise InputError(f"{out}: the folder it would be in does not exist.")
    try:
        with out.open("xb") as file:
            file.write(data)
    except FileExistsError as error:
        raise InputError(f"{out}: exists already.", "Choose another name.") from error
    except OSError as error:
        with contextlib.suppress(OSError):
            out.unlink()
        raise WorkError(
            f"{out}: could not be written ({error.strerror}).", "Choose another place."
        ) from error
    typer.echo(f"{out}: print at 100 %, measure a square, and tell it with --square-mm.")


def run(
    source: str = typer.Argument(
        ..., metavar="DEVICE|FOLDER", help="A live camera (geoderm devices), or a folder of views."
    ),
    views: int = typer.Option(25, "--views", min=6, max=200, help="Views to collect from a camera."),
    paper: str = _PAPER,
    square_mm: float | None = _SQUARE,
    seconds: float = typer.Option(600.0, "--seconds", min=1.0, help="Stop collecting after this time."),
    keep: Path | None = typer.Option(
        None, "--keep", help="Keep the pictures of the views in this new folder."
    ),
    profiles: Path | None = _PROFILES,
    as_json: bool = _JSON,
) -> None:
    """Collect views of the board, calibrate, judge, keep the profile. A refused set of views exits with 3."""
    store = _store(profiles, may_be_new=True)
    if Path(source).is_dir():
        session = _folder_session(Path(source), square_mm, views)
    else:
        session = _collected(source, _spec(paper, square_mm), views, seconds, keep)
    result = session.solve(_note_progress)
    told = result_report(result)
    refused = result.verdict.grade == "refused"
    if not refused:
        told["saved"] = True
        told["profile"] = session.save(store, result).document()
    typer.echo(json.dumps(told, indent=1) if as_json else result_text(told))
    if refused:
        session.save(store, result)


def check(
    source: str = typer.Argument(..., metavar="DEVICE|FOLDER"),
    paper: str = _PAPER,
    square_mm: float | None = _SQUARE,
    seconds: float = typer.Option(30.0, "--seconds", min=1.0, help="Give up after this time."),
    profiles: Path | None = _PROFILES,
    as_json: bool = _JSON,
) -> None:
    """See whether a rig still stands as calibrated: hold up the board for ten seconds. Exit 3 if not."""
    store = _store(profiles)
    if Path(source).is_dir():
        from core.calibration.daily_check import check_rig
        from core.calibration.view_folder import read_views

        info, views = read_views(Path(source), _metres(square_mm))
        result = check_rig(_profile_of(store, info.depth_serial, info.color_serial), info.spec, views)
    else:
        result = _checked(source, _spec(paper, square_mm), seconds, store)
    typer.echo(json.dumps(check_report(result), indent=1) if as_json else check_text(result))
    if result.verdict != "ok":
        raise typer.Exit(3)


def list_profiles(profiles: Path | None = _PROFILES, as_json: bool = _JSON) -> None:
    """List the calibration profiles, the newest of each rig marked."""
    store = _store(profiles)
    found = store.all()
    newest = {(p.depth_serial, p.color_serial): p.version for p in found}
    if as_json:
        rows = [
            {
                "id": p.id,
                "depth_serial": p.depth_serial,
                "color_serial": p.color_serial,
                "version": p.version,
                "made_at": p.made_at.isoformat(timespec="seconds"),
                "views": p.views,
                "in_force": newest[p.depth_serial, p.color_serial] == p.version,
            }
            for p in found
        ]
        typer.echo(json.dumps({"profiles": rows, "damaged": [f.name for f in store.damaged()]}, indent=1))
        return
    for p in found:
        mark = "in force" if newest[p.depth_serial, p.color_serial] == p.version else ""
        serials = (
            p.depth_serial
            if p.color_serial in ("", p.depth_serial)
            else f"{p.depth_serial} + {p.color_serial}"
        )
        typer.echo(
            f"{p.id}  {p.made_at:%Y-%m-%d %H:%M}  version {p.version}  {p.views} views  "
            f"{serials}  {mark}".rstrip()
        )
    for path in store.damaged():
        typer.echo(f"{path.name}: not readable as a calibration profile", err=True)
    if not found:
        typer.echo("There is no calibration profile.")


def show(
    profile: str = typer.Argument(
        ..., help="Id of a profile (geoderm calibrate list), its first letters, or a file."
    ),
    profiles: Path | None = _PROFILES,
    as_json: bool = _JSON,
) -> None:
    """Show one calibration profile with the uncertainty of each parameter."""
    found = _named_profile(_store(profiles), profile)
    typer.echo(json.dumps(found.document(), indent=1) if as_json else profile_text(found))


# ---------------------------------------------------------------- work


def _store(profiles: Path | None, *, may_be_new: bool = False) -> ProfileStore:
    from app.paths import calibration_dir
    from core.calibration.profile import ProfileStore
    from core.errors import InputError

    new = profiles is not None and not profiles.exists() and not profiles.is_symlink()
    if profiles is not None and not profiles.is_dir() and not (new and may_be_new):
        raise InputError(f"{profiles}: there is no such folder of calibration profiles.")
    return ProfileStore(profiles or calibration_dir())


def _metres(square_mm: float | None) -> float | None:
    return None if square_mm is None else square_mm / 1000


def _spec(paper: str, square_mm: float | None) -> BoardSpec:
    from core.calibration.board import BoardSpec

    spec = BoardSpec.for_paper(paper)
    return spec if square_mm is None else spec.with_square(square_mm / 1000)


def _live(source: str) -> LiveCamera:
    from core.errors import InputError
    from devices.live import LiveCamera
    from devices.registry import open_device

    if ":" not in source:
        raise InputError(
            f"{source}: there is no such folder, and it names no camera.", "See geoderm devices."
        )
    camera = open_device(source)
    if not isinstance(camera, LiveCamera):
        camera.close()
        raise InputError(f"{source}: is not a live camera.", "Give a live camera, or a folder of views.")
    return camera


def _collected(source: str, spec: BoardSpec, views: int, seconds: float, keep: Path | None) -> Any:
    from app.workflows.calibrating import CalibrationSession, start_streams
    from app.workflows.calibration_steps import Outcome
    from core.calibration.view_folder import ViewFolderInfo, ViewFolderWriter
    from core.errors import WorkError

    camera = _live(source)
    with camera:
        together = start_streams(camera, color=bool(camera.identity.color_serial))
        who = camera.identity
        session = CalibrationSession(who, spec, together, color=bool(who.color_serial), wanted=views)
        writer = None
        if keep is not None:
            info = ViewFolderInfo(who.depth_serial, who.color_serial, who.model, who.sensor, spec)
            writer = ViewFolderWriter(keep, info)
        pictures: dict[str, Any] = {}
        streams, number, said = None, 0, ""
        until = time.monotonic() + seconds
        while len(session.views) < views:
            if time.monotonic() > until:
                break
            if session.streams != streams:
                streams = session.streams
                camera.start(streams)
            frame = camera.latest(number, 3.0)
            if frame is None:
                raise WorkError(
                    "The camera has stopped delivering frames.", "Check its cable, then start again."
                )
            number = frame.number
            for kind, image in (("infrared", frame.infrared), ("rgb", frame.rgb), ("depth", frame.depth)):
                if image is not None:
                    pictures[kind] = image
            step = session.add_frame(frame)
            if step.message != said:
                said = step.message
                typer.echo(said, err=True)
            if step.outcome is Outcome.ADDED and writer is not None:
                writer.add(pictures.get("infrared"), pictures.get("rgb"), pictures.get("depth"))
    return session


def _folder_session(folder: Path, square_mm: float | None, views: int) -> Any:
    from app.workflows.calibrating import CalibrationSession
    from core.calibration.view_folder import read_views
    from devices.live import CameraIdentity

    info, found = read_views(folder, _metres(square_mm), _note_progress)
    identity = CameraIdentity(info.model, info.depth_serial, info.color_serial, info.sensor)
    session = CalibrationSession(
        identity, info.spec, color=any(v.color is not None for v in found), wanted=views
    )
    for view in found:
        session.add_view(view)
    return session


def _checked(source: str, spec: BoardSpec, seconds: float, store: ProfileStore) -> CheckResult:
    from app.workflows.calibrating import start_streams
    from app.workflows.calibration_check import CheckSession
    from core.errors import WorkError

    camera = _live(source)
    with camera:
        who = camera.identity
        profile = _profile_of(store, who.depth_serial, who.color_serial)
        session = CheckSession(profile, who, spec, start_streams(camera, color=profile.rig.has_color))
        streams, number, said = None, 0, ""
        until = time.monotonic() + seconds
        while not session.done() and time.monotonic() < until:
            if session.streams != streams:
                streams = session.streams
                camera.start(streams)
            frame = camera.latest(number, 3.0)
            if frame is None:
                raise WorkError(
                    "The camera has stopped delivering frames.", "Check its cable, then start again."
                )
            number = frame.number
            step = session.add_frame(frame)
            if step.message != said:
                said = step.message
                typer.echo(said, err=True)
    return session.result()


def _profile_of(store: ProfileStore, depth_serial: str, color_serial: str) -> CalibrationProfile:
    from core.errors import WorkError

    profile = store.newest(depth_serial, color_serial)
    if profile is None:
        raise WorkError(
            "These cameras have no calibration profile.", "Calibrate them first: geoderm calibrate run."
        )
    return profile


def _named_profile(store: ProfileStore, name: str) -> CalibrationProfile:
    from core.calibration.profile import read_profile
    from core.errors import InputError

    if Path(name).is_file():
        return read_profile(Path(name))
    found = [p for p in store.all() if p.id.startswith(name)]
    if len(found) != 1:
        what = "no calibration profile" if not found else "more than one calibration profile"
        raise InputError(f"'{name}': there is {what} of this name.", "See geoderm calibrate list.")
    return found[0]


def _note_progress(fraction: float, message: str = "") -> None:
    """Nothing: the command is quick enough."""
