"""Long work away from the window: progress, cancel, failures, order, the end; and the overlay over it."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from PySide6.QtCore import Qt, QTimer
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QLabel, QProgressBar, QPushButton, QWidget
from pytestqt.qtbot import QtBot

from app.tasks import Task, TaskFailure, TaskRunner
from app.tasks.failures import BUG_MESSAGE
from app.widgets.status import ProgressOverlay
from core.errors import InputError
from core.progress import Progress
from tests.gui.conftest import Show


@pytest.fixture
def runner(qapp: QApplication) -> Iterator[TaskRunner]:
    tasks = TaskRunner()
    yield tasks
    tasks.shut_down()


class Outcome:
    """Every signal of a task in the order they came, and the threads they came in."""

    def __init__(self, task: Task) -> None:
        self.events: list[tuple[str, Any]] = []
        self.threads: set[threading.Thread] = set()
        task.progressed.connect(lambda share, text: self._add("progressed", (share, text)))
        task.finished.connect(lambda result: self._add("finished", result))
        task.failed.connect(lambda failure: self._add("failed", failure))
        task.cancelled.connect(lambda: self._add("cancelled", None))
        task.ended.connect(lambda: self._add("ended", None))

    def _add(self, kind: str, value: object) -> None:
        self.events.append((kind, value))
        self.threads.add(threading.current_thread())

    @property
    def kinds(self) -> list[str]:
        return [kind for kind, _ in self.events if kind != "progressed"]

    def only(self, kind: str) -> Any:
        (value,) = [v for k, v in self.events if k == kind]
        return value


def until_idle(runner: TaskRunner, qtbot: QtBot) -> None:
    qtbot.waitUntil(lambda: not runner.busy, timeout=30_000)


def until_told_to_stop(progress: Progress) -> None:
    while True:
        progress(0.5, "Working")
        time.sleep(0.005)


def test_the_result_and_the_progress_arrive_in_the_window_s_thread(runner: TaskRunner, qtbot: QtBot) -> None:
    worked_in: list[threading.Thread] = []

    def work(progress: Progress) -> str:
        worked_in.append(threading.current_thread())
        for i in range(1, 101):
            progress(i / 100, f"part {i}")
        return "found"

    outcome = Outcome(runner.start("Finding", work))
    until_idle(runner, qtbot)
    assert outcome.only("finished") == "found"
    assert outcome.kinds == ["finished", "ended"]
    assert outcome.threads == {threading.main_thread()}
    assert worked_in != [threading.main_thread()]
    shares = [value[0] for kind, value in outcome.events if kind == "progressed"]
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    assert len(shares) < 50, "the window is told at most 25 times a second"


def test_the_window_stays_alive_while_work_runs(runner: TaskRunner, qtbot: QtBot) -> None:
    ticks: list[float] = []
    timer = QTimer(interval=10)
    timer.timeout.connect(lambda: ticks.append(time.monotonic()))
    timer.start()
    runner.start("Sleeping", lambda progress: time.sleep(0.4))
    until_idle(runner, qtbot)
    timer.stop()
    assert len(ticks) > 10


def test_a_cancelled_task_stops_at_its_next_report_and_tells_nothing_else(
    runner: TaskRunner, qtbot: QtBot
) -> None:
    task = runner.start("Endless", until_told_to_stop)
    outcome = Outcome(task)
    qtbot.waitUntil(lambda: bool(outcome.events), timeout=5000)
    task.cancel()
    until_idle(runner, qtbot)
    assert outcome.kinds == ["cancelled", "ended"]


def test_a_task_cancelled_while_it_waits_never_begins(runner: TaskRunner, qtbot: QtBot) -> None:
    gate = threading.Event()
    begun: list[bool] = []
    runner.start("First", lambda progress: gate.wait(10))
    second = runner.start("Second", lambda progress: begun.append(True))
    outcome = Outcome(second)
    second.cancel()
    gate.set()
    until_idle(runner, qtbot)
    assert outcome.kinds == ["cancelled", "ended"]
    assert not begun


def test_a_failure_of_the_world_is_told_in_its_own_words_and_not_logged(
    runner: TaskRunner, qtbot: QtBot, logged: list[str]
) -> None:
    def work(progress: Progress) -> None:
        raise InputError("depth.png: the file is cut off.", "Take the capture again.")

    outcome = Outcome(runner.start("Reading", work))
    until_idle(runner, qtbot)
    expected = TaskFailure("depth.png: the file is cut off.", "Take the capture again.", is_bug=False)
    assert outcome.only("failed") == expected
    assert outcome.kinds == ["failed", "ended"]
    assert not logged


def test_a_bug_is_told_plainly_and_logged_by_file_and_line_without_any_value(
    runner: TaskRunner, qtbot: QtBot, logged: list[str]
) -> None:
    def work(progress: Progress) -> None:
        patient = "Nováková, Eva"
        try:
            {}[patient]
        except KeyError as error:
            raise RuntimeError(f"cannot place {patient}") from error

    outcome = Outcome(runner.start("Placing", work))
    until_idle(runner, qtbot)
    failure = outcome.only("failed")
    assert failure.is_bug
    assert failure.message == BUG_MESSAGE
    assert failure.advice
    (entry,) = logged
    assert "RuntimeError" in entry
    assert "KeyError" in entry
    assert "test_tasks.py" in entry
    assert "Nov" not in entry, "a log never holds patient data"


@pytest.fixture
def logged() -> Iterator[list[str]]:
    """What the application logs."""
    entries: list[str] = []

    class Keep(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            entries.append(record.getMessage())

    handler, logger = Keep(), logging.getLogger("geoderm")
    logger.addHandler(handler)
    yield entries
    logger.removeHandler(handler)


def test_work_runs_one_after_another_in_the_order_it_was_started(runner: TaskRunner, qtbot: QtBot) -> None:
    order: list[str] = []
    threads: set[int] = set()
    busy: list[bool] = []
    runner.busy_changed.connect(busy.append)

    def work(name: str) -> Callable[[Progress], None]:
        def run(progress: Progress) -> None:
            order.append(f"{name} begins")
            threads.add(threading.get_ident())
            time.sleep(0.02)
            order.append(f"{name} ends")

        return run

    for name in ("a", "b", "c"):
        runner.start(name, work(name))
    until_idle(runner, qtbot)
    assert order == [f"{name} {what}" for name in ("a", "b", "c") for what in ("begins", "ends")]
    assert len(threads) == 1
    assert busy == [True, False]


def test_a_failure_does_not_end_the_worker(runner: TaskRunner, qtbot: QtBot) -> None:
    def fail(progress: Progress) -> None:
        raise InputError("No body was found.", "Step into the picture.")

    told: list[TaskFailure] = []
    runner.unhandled.connect(told.append)
    runner.start("Nobody waits for this", fail, quiet=True)
    after = Outcome(runner.start("Next", lambda progress: 7))
    until_idle(runner, qtbot)
    assert [f.message for f in told] == ["No body was found."]
    assert after.only("finished") == 7


def test_shutting_down_cancels_what_runs_and_what_waits(qapp: QApplication) -> None:
    runner = TaskRunner()
    begun: list[bool] = []
    started = threading.Event()

    def endless(progress: Progress) -> None:
        started.set()
        until_told_to_stop(progress)

    runner.start("Endless", endless)
    runner.start("Waiting", lambda progress: begun.append(True))
    assert started.wait(5)
    before = time.monotonic()
    assert runner.shut_down()
    assert time.monotonic() - before < 2
    assert not begun
    assert "geoderm-tasks" not in {t.name for t in threading.enumerate()}


def test_work_that_does_not_stop_in_time_is_reported_at_the_end(
    qapp: QApplication, logged: list[str]
) -> None:
    runner = TaskRunner()
    gate, started = threading.Event(), threading.Event()

    def deaf(progress: Progress) -> None:
        started.set()
        gate.wait(20)

    runner.start("Deaf", deaf)
    assert started.wait(5)
    assert not runner.shut_down(timeout_s=0.1)
    assert any("did not end" in entry for entry in logged)
    gate.set()
    assert runner.shut_down()


def test_extensions_may_be_called_again_and_again_in_the_worker(runner: TaskRunner, qtbot: QtBot) -> None:
    def work(progress: Progress) -> int:
        import open3d

        mesh = open3d.geometry.TriangleMesh.create_sphere(resolution=8)
        progress(0.5, "Normals")
        mesh.compute_vertex_normals()
        scene = open3d.t.geometry.RaycastingScene()
        scene.add_triangles(open3d.t.geometry.TriangleMesh.from_legacy(mesh))
        rays = open3d.core.Tensor([[0.0, 0.0, -3.0, 0.0, 0.0, 1.0]], dtype=open3d.core.float32)
        return round(float(scene.cast_rays(rays)["t_hit"].numpy()[0]))

    outcomes = []
    for _ in range(3):
        outcomes.append(Outcome(runner.start("Casting a ray", work)))
        until_idle(runner, qtbot)
    assert [o.only("finished") for o in outcomes] == [2, 2, 2]


def test_the_overlay_shows_the_work_and_its_cancel_button_stops_it(
    runner: TaskRunner, qtbot: QtBot, show: Show
) -> None:
    page = show(QWidget(), (640, 480))
    overlay = ProgressOverlay(page, delay_ms=20)
    task = runner.start("Finding the lesions", until_told_to_stop)
    outcome = Outcome(task)
    overlay.attach(task)
    qtbot.waitUntil(overlay.isVisible, timeout=3000)
    qtbot.waitUntil(lambda: overlay.findChild(QProgressBar, "progress_bar").value() == 500, timeout=3000)
    assert overlay.findChild(QLabel, "progress_title").text() == "Finding the lesions"
    assert overlay.findChild(QLabel, "progress_message").text() == "Working"
    page.resize(800, 600)
    QApplication.processEvents()
    assert overlay.size() == page.size()
    cancel = overlay.findChild(QPushButton, "progress_cancel")
    QTest.mouseClick(cancel, Qt.MouseButton.LeftButton)
    assert not cancel.isEnabled()
    assert cancel.text() == "Stopping"
    until_idle(runner, qtbot)
    assert outcome.kinds == ["cancelled", "ended"]
    assert not overlay.isVisible()
    assert overlay.task is None


def test_the_overlay_does_not_flash_for_short_work_and_hides_cancel_where_there_is_none(
    runner: TaskRunner, qtbot: QtBot, show: Show
) -> None:
    page = show(QWidget(), (640, 480))
    overlay = ProgressOverlay(page, delay_ms=150)
    overlay.attach(runner.start("Short", lambda progress: None))
    until_idle(runner, qtbot)
    QTest.qWait(250)
    assert not overlay.isVisible()
    gate = threading.Event()
    overlay.attach(runner.start("Writing", lambda progress: gate.wait(10), cancellable=False))
    qtbot.waitUntil(overlay.isVisible, timeout=3000)
    assert not overlay.findChild(QPushButton, "progress_cancel").isVisible()
    gate.set()
    until_idle(runner, qtbot)
    assert not overlay.isVisible()
