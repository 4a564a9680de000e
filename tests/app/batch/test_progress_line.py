"""The line that says how far a run is."""

from __future__ import annotations

import io

import pytest

from app.batch.progress_line import ProgressLine, describe, duration
from app.batch.run import Progress


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_rate_and_remaining_time_count_what_this_run_computed() -> None:
    told = describe(Progress(1000, kept=400, done=90, failed=10, workers=2, seconds=200.0))
    assert told == "500 of 1000 pairs, 10 failed, 30.0 a minute, 16 min 40 s left, 2 workers"


def test_nothing_is_promised_before_the_first_pair() -> None:
    assert describe(Progress(10, kept=3, workers=1)) == "3 of 10 pairs, 1 worker"


@pytest.mark.parametrize(
    ("seconds", "told"), [(0, "0 s"), (61, "1 min 1 s"), (7384, "2 h 3 min"), (200_000, "2 d 7 h")]
)
def test_durations_have_their_two_largest_units(seconds: float, told: str) -> None:
    assert duration(seconds) == told


def test_a_terminal_sees_one_line_that_is_taken_away_at_the_end() -> None:
    terminal = Terminal()
    line = ProgressLine(terminal)
    line(Progress(10, kept=3, workers=1))
    line.close()
    assert "3 of 10 pairs" in terminal.getvalue()
    assert "\n" not in terminal.getvalue()
    assert terminal.getvalue().endswith(" \r")


def test_a_file_sees_nothing() -> None:
    file = io.StringIO()
    line = ProgressLine(file)
    line(Progress(10, done=1, seconds=1.0))
    line.close()
    assert file.getvalue() == ""
