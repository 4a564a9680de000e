"""The command: exit codes, one clear line for an error, never a traceback."""

from __future__ import annotations

from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

import app.cli.main as command
from core.errors import InputError, WorkError

COMMANDS = [
    "run",
    "demo",
    "capture-info",
    "relocate",
    "relocate-batch",
    "verify-site",
    "geodesics",
    "simulate",
    "records",
    "evaluate",
    "devices",
    "calibrate",
    "capture",
    "record",
    "play",
]


@pytest.fixture(autouse=True)
def _own_log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GEODERM_LOG_DIR", str(tmp_path / "log"))


def test_help_lists_every_command() -> None:
    shown = CliRunner().invoke(command.build_app(), ["--help"]).stdout
    assert all(name in shown for name in COMMANDS)


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_explains_itself(name: str) -> None:
    result = CliRunner().invoke(command.build_app(), [name, "--help"])
    assert result.exit_code == 0
    assert "Usage" in result.stdout


def test_an_unknown_command_is_wrong_use() -> None:
    assert command.main(["no-such-command"]) == 2


@pytest.mark.parametrize(
    ("error", "code"),
    [
        (InputError("a.json: lesions: missing.", "Add it."), 2),
        (WorkError("No body found."), 3),
        (OSError(36, "File name too long", "abc"), 2),
        (OSError(28, "No space left on device", "abc"), 3),
    ],
)
def test_an_error_of_the_world_is_one_line_and_its_code(
    error: Exception, code: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(command, "build_app", lambda: _failing(error))
    assert command.main([]) == code
    shown = capsys.readouterr().err
    assert shown.count("\n") == 1
    if isinstance(error, OSError):
        assert f"abc: {error.strerror}" in shown
    else:
        assert str(error) in shown


def test_output_to_a_full_disk_is_told(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(command, "build_app", lambda: _failing(OSError(28, "No space left on device")))
    assert command.main([]) == 3
    assert capsys.readouterr().err == "geoderm: the output could not be written: the disk is full\n"


def test_ctrl_c_behind_the_error_of_a_library_is_no_bug(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A native module that is interrupted while it loads raises ImportError from KeyboardInterrupt."""
    error = ImportError("initialization failed")
    error.__cause__ = KeyboardInterrupt()
    monkeypatch.setattr(command, "build_app", lambda: _failing(error))
    assert command.main([]) == 130
    assert capsys.readouterr().err == "geoderm: stopped\n"


def test_a_bug_is_logged_with_its_trace_and_told_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    import logging

    logging.getLogger("geoderm").handlers.clear()
    monkeypatch.setattr(command, "build_app", lambda: _failing(RuntimeError("boom")))
    assert command.main([]) == 3
    shown = capsys.readouterr().err
    assert shown.count("\n") == 1
    assert "Traceback" not in shown
    assert "boom" in (tmp_path / "log" / "geoderm.log").read_text()
    logging.getLogger("geoderm").handlers.clear()


def _failing(error: Exception) -> typer.Typer:
    app = typer.Typer(pretty_exceptions_enable=False)

    @app.command()
    def fail() -> None:
        raise error

    return app
