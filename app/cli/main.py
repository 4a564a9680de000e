"""The ``geoderm`` command: collects the subcommands and turns errors into exit codes.

Exit codes: 0 done; 2 wrong use or bad input; 3 the work could not be done. Never a traceback: an error of
the world is one line on standard error; a bug is logged with its trace and told in one line.
"""

from __future__ import annotations

import errno
import importlib
import os
import sys
import warnings

import typer
from typer import TyperException

from app.logs import log_bug
from core.errors import GeodermError

COMMAND_MODULES = (
    "app.cli.gui",
    "app.cli.capture_info",
    "app.cli.relocate",
    "app.cli.relocate_batch",
    "app.cli.verify_site",
    "app.cli.geodesics",
    "app.cli.simulate",
    "app.cli.records",
    "app.cli.evaluate",
    "app.cli.devices",
    "app.cli.calibrate",
    "app.cli.record",
    "app.cli.play",
    "app.cli.capture",
    "app.cli.hand",
)
"""Each has ``register(app)``. Their heavy imports happen inside the commands."""

_WRONG_PATH = (errno.ENAMETOOLONG, errno.ENOENT, errno.ENOTDIR, errno.EISDIR, errno.ELOOP)
"""What a path itself is to blame for; anything else is the world's."""


def build_app() -> typer.Typer:
    """Typer application with every subcommand."""
    cli = typer.Typer(
        name="geoderm",
        help="Finds every mole of a patient again. Measures and relocates; it does not diagnose.",
        no_args_is_help=True,
        add_completion=False,
        pretty_exceptions_enable=False,
        rich_markup_mode=None,
    )
    for name in COMMAND_MODULES:
        importlib.import_module(name).register(cli)
    return cli


def run(arguments: list[str] | None = None) -> None:
    """Run the command and leave the process with its exit code."""
    # Numbers of bad input that overflow are found by the checks on the results; one line is told, no more.
    warnings.simplefilter("ignore", RuntimeWarning)
    # The same for OpenCV, which tells of a damaged picture in words of its own.
    os.environ.setdefault("OPENCV_LOG_LEVEL", "ERROR")
    sys.exit(main(arguments))


def main(arguments: list[str] | None = None) -> int:
    """Run the command and return its exit code."""
    try:
        code = build_app()(args=arguments, prog_name="geoderm", standalone_mode=False)
        return code if isinstance(code, int) else 0
    except SystemExit as stop:
        return stop.code if isinstance(stop.code, int) else (0 if stop.code is None else 2)
    except GeodermError as error:
        sys.stderr.write(f"geoderm: {' '.join(str(error).split())}\n")
        return error.exit_code
    except TyperException as error:
        sys.stderr.write(_wrong_use(error))
        return 2
    except (KeyboardInterrupt, typer.Abort):
        sys.stderr.write("geoderm: stopped\n")
        return 130
    except BrokenPipeError:
        return 0
    except OSError as error:
        if error.filename is None and error.errno == errno.ENOSPC:
            sys.stderr.write("geoderm: the output could not be written: the disk is full\n")
            return 3
        if error.filename is None:
            return _bug()
        sys.stderr.write(f"geoderm: {str(error.filename)[:300]}: {error.strerror or error}\n")
        if error.errno in _WRONG_PATH:
            return 2
        log_bug("command line")
        return 3
    except Exception as error:  # noqa: BLE001 - the outermost door: a bug is logged with its trace, never shown
        if _interrupted(error):
            sys.stderr.write("geoderm: stopped\n")
            return 130
        return _bug()


def _interrupted(error: BaseException | None) -> bool:
    """Whether Ctrl-C is behind an error: a library that is being loaded turns it into one of its own."""
    while error is not None:
        if isinstance(error, KeyboardInterrupt):
            return True
        error = error.__cause__ or error.__context__
    return False


def _bug() -> int:
    path = log_bug("command line")
    sys.stderr.write(f"geoderm: internal error; nothing was changed. Details are in {path}\n")
    return 3


def _wrong_use(error: TyperException) -> str:
    """One line for a wrong option or argument; the help where a command was called with nothing at all."""
    told = error.format_message() if hasattr(error, "format_message") else str(error)
    context = getattr(error, "ctx", None)
    if type(error).__name__ == "NoArgsIsHelpError":
        return f"{told}\n"
    command = "geoderm" if context is None else context.command_path
    return f"{command}: {' '.join(told.split())} (help: {command} --help)\n"
