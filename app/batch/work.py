"""What a worker does: prepares itself once, then relocates one pair after another."""

from __future__ import annotations

import contextlib
import time
import traceback
from pathlib import Path

from app.batch.case import Case, CaseOutcome
from app.batch.fingerprint import fingerprint
from app.batch.memory import forget_peak, peak_bytes
from core.errors import GeodermError


def prepare_process() -> None:
    """Load the compiled kernels and the skeleton tracker: the first pair then costs what the others cost."""
    from core.warm_up import warm_up
    from devices.trackers import default_tracker

    warm_up()
    with contextlib.suppress(GeodermError):  # every pair that needs the tracker says why it cannot run
        default_tracker()


def run_case(case: Case) -> CaseOutcome:
    """Relocate one pair. Whatever is wrong with it is in the outcome; nothing is raised."""
    from app.batch.one_pair import relocate_folders

    start = time.perf_counter()
    forget_peak()
    print_of_inputs, reason, document, trace = "", "", None, ""
    try:
        print_of_inputs = fingerprint(case)
        document = relocate_folders(
            Path(case.first),
            Path(case.followup),
            Path(case.lesions),
            method=case.method,
            appearance=case.appearance,
            seed=case.seed,
        ).document
    except GeodermError as error:
        reason = " ".join(str(error).split()) or "No reason is known."
    except MemoryError:
        print_of_inputs, reason = "", "There was not enough memory."
    except Exception as error:  # noqa: BLE001 - the door of the worker: a bug costs one row, not the cohort
        print_of_inputs, trace = "", _trace(error)
        reason = f"Internal error ({type(error).__name__}); the log holds its details."
    return CaseOutcome(
        case.name, print_of_inputs, reason, document, time.perf_counter() - start, peak_bytes(), trace
    )


def run_case_on_one_core(case: Case) -> CaseOutcome:
    """`run_case`, where the cores of the machine are shared out by processes."""
    import cv2
    import numba

    cv2.setNumThreads(1)
    numba.set_num_threads(1)
    return run_case(case)


def _trace(error: BaseException) -> str:
    """Where a bug happened and its kind; its message may name folders, which may be named after patients."""
    return "".join(traceback.format_tb(error.__traceback__)) + type(error).__name__
