"""The world's errors: told to the user with what to do. Anything else that is raised is a bug."""

from __future__ import annotations


class GeodermError(Exception):
    """An error of the world (bad file, no body, camera gone), with advice for the person at the screen.

    Parameters
    ----------
    message : str
        What happened, naming the file and the field where there is one. One sentence, no patient data.
    advice : str
        What the user can do about it.
    """

    exit_code = 3

    def __init__(self, message: str, advice: str = "") -> None:
        super().__init__(message)
        self.message = message
        self.advice = advice

    def __str__(self) -> str:
        return f"{self.message} {self.advice}".strip()


class InputError(GeodermError):
    """Wrong use or bad input: unreadable, contradictory, out of range. Exit code 2."""

    exit_code = 2


class WorkError(GeodermError):
    """The input is readable, but the work could not be done (for example no body found). Exit code 3."""

    exit_code = 3


class Cancelled(GeodermError):
    """The user cancelled a long task; nothing was kept."""

    def __init__(self) -> None:
        super().__init__("Cancelled.")
