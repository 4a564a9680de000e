"""``geoderm records``: the clinic's records from the command line."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from core.errors import InputError

if TYPE_CHECKING:
    from core.records import ClinicStore, User

_DATA = typer.Option(None, "--data", help="Clinic folder. Default: the application's own.")
_USER = typer.Option(None, "--user", help="Sign the change as this user. Default: the only user there is.")
_JSON = typer.Option(False, "--json", help="Print JSON.")
_LARGEST = 2**63 - 1
_PATIENT = typer.Argument(..., min=1, max=_LARGEST, help="Record number of the patient.")


def register(app: typer.Typer) -> None:
    """Add the command group."""
    group = typer.Typer(help="Patients, visits and lesions of a clinic.", no_args_is_help=True)
    group.command("patients")(patients)
    group.command("add-patient")(add_patient)
    group.command("visits")(visits)
    group.command("lesions")(lesions)
    group.command("report")(report)
    group.command("export-capture")(export_capture)
    group.command("add-user")(add_user)
    group.command("verify")(verify)
    app.add_typer(group, name="records")


@contextmanager
def _store(data: Path | None, *, create: bool = False) -> Iterator[ClinicStore]:
    from app.paths import default_data_dir
    from core.records import ClinicStore

    folder = data or default_data_dir()
    if not create and not (folder / "clinic.db").exists():
        raise InputError(f"{folder}: there is no clinic here.", "Name its folder with --data.")
    store = ClinicStore.open(folder)
    try:
        yield store
    finally:
        store.close()


def _acting_user(store: ClinicStore, username: str | None) -> User:
    users = store.users.list()
    if username is None and len(users) == 1:
        return users[0]
    for user in users:
        if user.username == username:
            return user
    raise InputError(
        "--user: there is no such user.", f"Users: {', '.join(u.username for u in users) or 'none'}."
    )


def _print(rows: list[dict[str, Any]], as_json: bool) -> None:
    if as_json:
        typer.echo(json.dumps(rows, indent=1, ensure_ascii=False))
        return
    if not rows:
        typer.echo("none")
        return
    widths = {k: max(len(k), *(len(str(r[k])) for r in rows)) for k in rows[0]}
    typer.echo("  ".join(f"{k:<{w}}" for k, w in widths.items()).rstrip())
    for row in rows:
        typer.echo("  ".join(f"{row[k]!s:<{w}}" for k, w in widths.items()).rstrip())


def patients(
    search: str = typer.Argument("", help="Part of a name or clinic number."),
    data: Path | None = _DATA,
    as_json: bool = _JSON,
) -> None:
    """List patients."""
    with _store(data) as store:
        found = store.patients.search(search, limit=1000)
    _print(
        [
            {
                "id": s.patient.id,
                "name": s.patient.full_name,
                "born": s.patient.birth_date.isoformat() if s.patient.birth_date else "",
                "number": s.patient.clinic_number,
                "visits": s.visit_count,
                "lesions": s.lesion_count,
                "last_visit": s.last_visit_at.date().isoformat() if s.last_visit_at else "",
            }
            for s in found
        ],
        as_json,
    )


def add_patient(
    family_name: str = typer.Argument(...),
    given_name: str = typer.Argument(""),
    born: str = typer.Option("", "--born", help="Birth date, YYYY-MM-DD."),
    sex: str = typer.Option("U", "--sex", help="F, M, O or U."),
    number: str = typer.Option("", "--number", help="The clinic's own number."),
    data: Path | None = _DATA,
    user: str | None = _USER,
) -> None:
    """Enter a patient and print the record's number."""
    from core.records import PatientDraft

    try:
        birth_date = date.fromisoformat(born) if born else None
    except ValueError as error:
        raise InputError(f"--born: '{born}' is not a date.", "Write YYYY-MM-DD.") from error
    draft = PatientDraft(family_name, given_name, birth_date, sex, number)
    with _store(data) as store:
        typer.echo(store.patients.create(draft, by=_acting_user(store, user).id).id)


def visits(patient: int = _PATIENT, data: Path | None = _DATA, as_json: bool = _JSON) -> None:
    """List the visits of a patient and their captures."""
    with _store(data) as store:
        store.patients.get(patient)
        rows = [
            {
                "id": v.id,
                "number": v.number,
                "started": v.started_at.isoformat(timespec="minutes"),
                "state": "open" if v.is_open else "closed",
                "captures": " ".join(f"{c.id}:{c.role}" for c in store.captures.list(v.id)),
                "observations": len(store.observations.for_visit(v.id)),
            }
            for v in store.visits.list(patient)
        ]
    _print(rows, as_json)


def lesions(patient: int = _PATIENT, data: Path | None = _DATA, as_json: bool = _JSON) -> None:
    """List the lesions of a patient with the last decision on each."""
    with _store(data) as store:
        store.patients.get(patient)
        rows = []
        for lesion in store.lesions.list(patient):
            seen = store.observations.for_lesion(lesion.id)
            last = seen[-1] if seen else None
            rows.append(
                {
                    "id": lesion.id,
                    "number": lesion.number,
                    "site": lesion.site.name if lesion.site else "",
                    "state": lesion.state,
                    "visits": len({o.visit_id for o in seen}),
                    "last": last.decision if last else "",
                    "images": len(store.dermoscopy.for_lesion(lesion.id)),
                }
            )
    _print(rows, as_json)


def report(
    visit: int = typer.Argument(
        ..., min=1, max=_LARGEST, help="Record number of the visit (geoderm records visits PATIENT)."
    ),
    out: Path = typer.Option(..., "--out", help="PDF to write."),
    data: Path | None = _DATA,
    user: str | None = _USER,
) -> None:
    """Write the report of a visit as PDF."""
    from core.exchange.report import write_visit_report

    with _store(data) as store:
        store.visits.get(visit)
        write_visit_report(store, visit, out, created_by=_acting_user(store, user))
    typer.echo(str(out))


def export_capture(
    capture: int = typer.Argument(..., min=1, max=_LARGEST, help="Record number of the capture."),
    out: Path = typer.Option(..., "--out", help="Capture folder to write."),
    data: Path | None = _DATA,
) -> None:
    """Write a stored capture as a capture folder."""
    from core.capture import write_capture

    if out.exists():
        raise InputError(f"{out}: exists already.", "Choose another name.")
    with _store(data) as store:
        write_capture(store.captures.load(capture), out)
    typer.echo(str(out))


def add_user(
    username: str = typer.Argument(...),
    display_name: str = typer.Option("", "--name", help="Name shown and printed. Default: the user name."),
    data: Path | None = _DATA,
) -> None:
    """Create a user; the password is asked for, or read from GEODERM_PASSWORD."""
    password = os.environ.get("GEODERM_PASSWORD") or typer.prompt(
        "Password", hide_input=True, confirmation_prompt=True
    )
    with _store(data, create=True) as store:
        typer.echo(store.users.create(username, display_name or username, password).id)


def verify(data: Path | None = _DATA) -> None:
    """Check every stored file against its hash; exit code 3 if something is damaged."""
    with _store(data) as store:
        problems = store.verify()
    for problem in problems:
        typer.echo(problem)
    if problems:
        raise typer.Exit(3)
    typer.echo("Everything stored is intact.")
