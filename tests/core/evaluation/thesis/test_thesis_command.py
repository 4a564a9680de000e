"""``geoderm evaluate thesis`` refuses what it cannot do in one line, before it works."""

from __future__ import annotations

import pytest
import typer
from typer.testing import CliRunner

from app.cli.evaluate_thesis import register
from core.errors import InputError


@pytest.fixture
def command():
    """Call the command; an error of the world comes out as it is."""
    group = typer.Typer(pretty_exceptions_enable=False)
    group.callback()(lambda: None)
    register(group)

    def call(*arguments):
        outcome = CliRunner().invoke(group, ["thesis", *map(str, arguments)])
        if isinstance(outcome.exception, InputError):
            raise outcome.exception
        return outcome

    return call


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("--figures", "8,12"), "no figure '12'"),
        (("--surface", "rough"), "no 'rough' surface"),
        (("--beside", "guessing"), "no relocation method 'guessing'"),
        (("--stances", "handstand"), "no stance 'handstand'"),
        (("--captures", "nowhere"), "nowhere: is not a folder"),
        (("--body", "giant", "--stances", "psi"), "giant"),
    ],
)
def test_wrong_use_is_told_in_words(command, tmp_path, arguments, told):
    with pytest.raises(InputError, match=told):
        command("--out", tmp_path / "out", *arguments)


def test_a_cache_of_something_else_is_refused(command, tmp_path):
    (tmp_path / "cache").mkdir()
    (tmp_path / "cache" / "letter.txt").write_text("keep me")
    with pytest.raises(InputError, match="is not empty"):
        command("--out", tmp_path / "out", "--cache", tmp_path / "cache")
    assert (tmp_path / "cache" / "letter.txt").read_text() == "keep me"


def test_a_recorded_wall_must_be_a_capture_folder(command, tmp_path):
    with pytest.raises(InputError, match="is not a folder"):
        command(
            "--out", tmp_path / "out", "--figures", "cpu,8", "--wall", tmp_path / "wall", "--captures", "."
        )
