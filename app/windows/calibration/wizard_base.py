"""The sheet of the calibration wizard: its pages, and the camera it has open."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from threading import Event
from typing import TYPE_CHECKING

from PySide6.QtCore import QEvent, QObject, Slot
from PySide6.QtWidgets import QStackedWidget, QWidget

from app.tasks import TaskFailure
from app.widgets.sheet import Sheet, ask
from app.widgets.status import MessageBanner, ProgressOverlay, StepBar
from app.windows.calibration.board_choice import load_choice
from app.windows.calibration.board_page import BoardPage
from app.windows.calibration.check_page import CheckPage
from app.windows.calibration.choose_page import ChoosePage
from app.windows.calibration.collect_page import CollectPage
from app.windows.calibration.feed import CalibrationFeed
from app.windows.calibration.known_cameras import KnownCamera
from app.windows.calibration.parts import Page
from app.windows.calibration.result_page import ResultPage
from app.windows.calibration.work import Checking, Collecting

if TYPE_CHECKING:
    from app.context import AppContext
    from core.progress import Progress
    from devices.camera import DepthCamera
    from devices.live import LiveCamera, StreamKind

STEPS = (("choose", "Camera"), ("board", "Board"), ("collect", "Views"), ("result", "Result"))
CLOSE_WAIT_S = 10.0


@dataclass(frozen=True, eq=False)
class Opened:
    """An open camera with what it can do."""

    camera: LiveCamera
    together: bool
    has_color: bool
    streams: frozenset[StreamKind]


class CalibrationSheet(Sheet):
    """Pages, feed and camera of the wizard; what happens on them is the wizard's.

    Parameters
    ----------
    parent : QWidget
    context : AppContext
    """

    def __init__(self, parent: QWidget, context: AppContext) -> None:
        super().__init__(parent, "Cameras and calibration", "calibration_wizard", width=None)
        self._context = context
        self._folder = context.profiles.folder
        self._known: KnownCamera | None = None
        self._choice = load_choice(self._folder)
        self._opened: Opened | None = None
        self._collecting: Collecting | None = None
        self._checking: Checking | None = None
        self._saved = False
        self._closing = False
        self.feed = CalibrationFeed(self)
        self.feed.lost.connect(self._on_lost)
        self.steps = StepBar(STEPS)
        self.steps.setObjectName("calibration_steps")
        self.head.insertWidget(1, self.steps, 1)
        self.banner = MessageBanner()
        self.banner.setObjectName("calibration_banner")
        self.body.addWidget(self.banner)
        self.stack = QStackedWidget()
        self.stack.setObjectName("calibration_pages")
        self.body.addWidget(self.stack, 1)
        self.choose, self.board, self.collect = ChoosePage(), BoardPage(), CollectPage()
        self.result, self.check = ResultPage(), CheckPage()
        for page in (self.choose, self.board, self.collect, self.result, self.check):
            self.stack.addWidget(page)
        self.overlay = ProgressOverlay(self)

    def _show(self, page: Page) -> None:
        self.stack.setCurrentWidget(page)
        self.banner.clear()
        key = {
            self.choose: "choose", self.board: "board", self.collect: "collect", self.result: "result"
        }.get(page, "choose")  # type: ignore[call-overload]  # fmt: skip
        names = [name for name, _ in STEPS]
        self.steps.set_current(key)
        self.steps.set_done(names[: names.index(key)])
        self.steps.setVisible(page is not self.check)
        self._primary = page.primary
        first = page.focusWidget() or page.primary
        if first is not None and self.isVisible():
            first.setFocus()

    # --- the camera -------------------------------------------------------------------------------------

    def _open_camera(self, then: Callable[[Opened], None]) -> None:
        known = self._known
        if known is None:
            return
        context, camera_id = self._context, known.info.id
        gone = self._give_back()

        def work(progress: Progress) -> Opened:
            from app.workflows.calibrating import start_streams

            gone.wait(CLOSE_WAIT_S)  # the same camera cannot be opened twice
            camera = context.open_camera(camera_id)
            try:
                live = _must_be_live(camera)
                has_color = any(mode.kind == "color" for mode in live.modes())
                together = start_streams(live, color=has_color)
            except BaseException:
                camera.close()
                raise
            kinds: set[StreamKind] = {"depth"}
            kinds |= (
                {"color", "infrared"} if together and has_color else {"color"} if has_color else {"infrared"}
            )
            return Opened(live, together, has_color, frozenset(kinds))

        task = context.tasks.start("Opening the camera", work)
        self.overlay.attach(task)
        task.finished.connect(lambda opened: self._on_opened(opened, then))
        task.failed.connect(self._on_open_failed)

    def _give_back(self) -> Event:
        """Let the feed close its camera; the event tells when it has."""
        closed = Event()
        self._opened = None
        if self.feed.running:
            self.feed.release(closed.set)
        else:
            closed.set()
        return closed

    def _on_opened(self, opened: Opened, then: Callable[[Opened], None]) -> None:
        if self._closing:
            self._context.tasks.start(
                "Closing the camera", lambda progress: opened.camera.close(), quiet=True, cancellable=False
            )
            return
        self._opened = opened
        then(opened)

    @Slot(object)
    def _on_open_failed(self, failure: TaskFailure) -> None:
        if self._closing:
            return
        page = self.stack.currentWidget()
        if page in (self.collect, self.check):
            page.lost(failure.message, failure.advice)  # type: ignore[union-attr]
        else:
            self.banner.show_failure(failure)

    @Slot(object)
    def _on_lost(self, failure: TaskFailure) -> None:
        page = self.stack.currentWidget()
        if not self._closing and page in (self.collect, self.check):
            page.lost(failure.message, failure.advice)  # type: ignore[union-attr]

    @property
    def _unsaved_views(self) -> int:
        return 0 if self._collecting is None or self._saved else len(self._collecting.session.views)

    def _ask_to_drop(self, title: str, confirm: str, then: Callable[[], None]) -> None:
        views = self._unsaved_views
        what = "1 view has" if views == 1 else f"{views} views have"
        text = f"{what} not become a saved calibration and would be lost."
        ask(self, title, text, confirm, then, danger=True)

    # --- the end ----------------------------------------------------------------------------------------

    @Slot()
    def close_sheet(self) -> None:
        """Take the sheet away; views that would be lost are asked about first."""
        if self._unsaved_views and not self._closing:
            self._ask_to_drop("Close the calibration?", "Close", self._close_now)
        else:
            self._close_now()

    def _close_now(self) -> None:
        self._shut()
        self.feed.outlive(self.window())
        super().close_sheet()

    def _shut(self, wait_s: float = 0.0) -> None:
        self._closing = True
        if self.overlay.task is not None:
            self.overlay.task.cancel()
        self.feed.close(wait_s)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:  # noqa: D102
        if watched is self.parent() and event.type() == QEvent.Type.Close:
            self._shut(CLOSE_WAIT_S)
        return super().eventFilter(watched, event)


def _must_be_live(camera: DepthCamera) -> LiveCamera:
    from core.errors import WorkError
    from devices.live import LiveCamera

    if not isinstance(camera, LiveCamera):
        raise WorkError("This camera has no live pictures.", "Choose a connected camera.")
    return camera
