"""The window "Hand joints"."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import QTimer, Signal, Slot
from PySide6.QtGui import QCloseEvent, QKeySequence, QShortcut
from PySide6.QtWidgets import QFileDialog, QHBoxLayout, QVBoxLayout, QWidget

from app.tasks import TaskFailure
from app.theme import style_class
from app.widgets.hand_picture import HandPicture
from app.widgets.status import MessageBanner, ProgressOverlay
from app.windows.hand.desk import HandDesk
from app.windows.hand.engine import HandEngine, Opened, told
from app.windows.hand.files import HandFiles
from app.windows.hand.options_sheet import OptionsSheet
from app.windows.hand.picture_card import PictureCard
from app.windows.hand.source_bar import SourceBar
from app.windows.hand.status_card import StatusCard
from app.windows.hand.training import Training
from app.windows.hand.transport import Transport
from app.windows.hand.watch_panel import WatchPanel
from app.workflows.hand_settings import HandSettings
from core.errors import InputError

if TYPE_CHECKING:
    from core.hand.hand_model import HandModel
    from devices.live import LiveCamera

TITLE = "Hand joints"
_RIGHT_WIDTH = 456
_LOOK_AGAIN_MS = 4000
"""Drivers are asked in the background: what they found is there a moment later."""


class HandWindow(QWidget):
    """Watch, train and export the joints of a hand.

    Parameters
    ----------
    desk : HandDesk

    Signals
    -------
    closed()
        It will not be shown again: make another one.
    """

    closed = Signal()

    def __init__(self, desk: HandDesk) -> None:
        super().__init__()
        self.setObjectName("hand_window")
        self.setWindowTitle(TITLE)
        style_class(self, "page")
        self.setMinimumSize(1180, 720)
        self.resize(1280, 800)
        self._desk = desk
        self.settings = HandSettings()
        self.model: HandModel | None = None
        self._path: Path | None = None
        self._opened: Opened | None = None
        self._closing = False
        self.engine = HandEngine(self)
        self.banner = MessageBanner()
        self.bar = SourceBar()
        self.card = PictureCard()
        self.status = StatusCard()
        self.transport = Transport()
        self.watch = WatchPanel()
        self.overlay = ProgressOverlay(self)
        self.files = HandFiles(self, desk.tasks, self.engine, self.banner, self.overlay, use=self.use_model)
        self.training = Training(
            self,
            desk.tasks,
            self.engine,
            self.card.picture,
            self.banner,
            self.overlay,
            use=self.use_model,
            save=self.files.save_model,
            settings=lambda: self.settings,
        )
        self._lay_out()
        self._connect()
        self._shortcuts()
        self.bar.show_model(None, "")
        self.training.panel.set_proposing(False)
        self._set_mode("watch")
        for after_ms in (0, _LOOK_AGAIN_MS):
            QTimer.singleShot(after_ms, self, self.look_for_cameras)

    @property
    def picture(self) -> HandPicture:
        """The picture of the hand."""
        return self.card.picture

    def _lay_out(self) -> None:
        left = QVBoxLayout()
        left.setSpacing(8)
        left.addWidget(self.card, 1)
        left.addWidget(self.status)
        left.addWidget(self.transport)
        self.training.panel.setFixedWidth(_RIGHT_WIDTH)
        self.watch.setFixedWidth(_RIGHT_WIDTH)
        body = QHBoxLayout()
        body.setContentsMargins(12, 8, 12, 12)
        body.setSpacing(8)
        body.addLayout(left, 1)
        body.addWidget(self.watch)
        body.addWidget(self.training.panel)
        message = QVBoxLayout()
        message.setContentsMargins(12, 8, 12, 0)
        message.addWidget(self.banner)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(0)
        column.addWidget(self.bar)
        column.addLayout(message)
        column.addLayout(body, 1)

    def _connect(self) -> None:
        self.bar.camera_chosen.connect(lambda i: self._unless_unsaved(lambda: self.open_camera(i)))
        self.bar.folder_asked.connect(lambda: self._unless_unsaved(self._ask_folder))
        self.bar.oni_asked.connect(lambda: self._unless_unsaved(self._ask_oni))
        self.bar.mode_chosen.connect(self._mode_asked)
        self.bar.model_asked.connect(self.files.ask_model)
        self.bar.export_asked.connect(self._ask_export)
        self.bar.options_asked.connect(self._show_options)
        self.bar.look_again.connect(self.look_for_cameras)
        self.transport.play_asked.connect(self._play)
        self.transport.step_asked.connect(self._step)
        self.transport.seek_asked.connect(self._seek)
        self.transport.speed_chosen.connect(self.engine.set_speed)
        self.engine.ticked.connect(self._on_tick)
        self.engine.opened.connect(self._on_opened)
        self.engine.failed.connect(self._on_failed)
        self.engine.playing_changed.connect(self.transport.set_playing)
        self.training.saved.connect(self._after_save)

    def _shortcuts(self) -> None:
        training = self.training

        def while_training(act: Callable[[], object]) -> Callable[[], None]:
            return lambda: act() if training.active else None  # type: ignore[func-returns-value, return-value]

        for keys, slot in (
            ("Ctrl+Space", self.transport.toggle),
            ("PgUp", lambda: self._step(-1)),
            ("PgDown", lambda: self._step(1)),
            ("H", self.card.zoom_to_hand),
            ("Ctrl+O", lambda: self._unless_unsaved(self._ask_folder)),
            ("Ctrl+E", self._ask_export),
            ("Ctrl+1", lambda: self._mode_asked("watch")),
            ("Ctrl+2", lambda: self._mode_asked("train")),
            ("Ctrl+S", while_training(training.panel.save.click)),
            ("Ctrl+Z", while_training(training.panel.undo.click)),
            ("S", while_training(training.panel.skip.click)),
            ("P", while_training(training.panel.propose.click)),
            ("Ctrl+L", while_training(training.panel.learn.click)),
        ):
            QShortcut(QKeySequence(keys), self, slot)

    # --- sources -----------------------------------------------------------------------------------------

    @Slot()
    def look_for_cameras(self) -> None:
        """Ask which cameras there are."""
        if self._closing:
            return
        cameras = self._desk.cameras
        task = self._desk.tasks.start(
            "Looking for cameras",
            lambda progress: [camera for camera in cameras.list() if camera.live],
            cancellable=False,
        )
        task.finished.connect(self.bar.set_cameras)
        task.failed.connect(self._tell_failure)

    def open_recording(self, path: Path) -> None:
        """Show a recorded sequence."""
        self.banner.clear()
        self._path = path
        self.bar.set_source(path.name)
        self.engine.open_recording(path)

    def open_camera(self, camera_id: str) -> None:
        """Show a live camera."""
        from devices.live import LiveCamera

        self.banner.clear()
        self._path = None
        self.bar.set_source(None, camera_id)
        self.card.say("Opening the camera")
        open_any = self._desk.open_camera

        def open_it() -> LiveCamera:
            camera = open_any(camera_id)
            if not isinstance(camera, LiveCamera):
                camera.close()
                raise InputError("This is not a live camera.", "Open recordings with 'Sequence…'.")
            return camera

        self.engine.open_camera(open_it)

    def release_camera(self) -> None:
        """Give a live camera back: somebody else needs it."""
        if self._opened is not None and self._opened.live:
            self.engine.release()
            self._source_gone("The camera was given back.")
            self.banner.show_info("The camera was given back to the visit.", "Choose it again afterwards.")

    @Slot()
    def _ask_folder(self) -> None:
        path = QFileDialog.getExistingDirectory(self, "Folder of captures")
        if path:
            self.open_recording(Path(path))

    @Slot()
    def _ask_oni(self) -> None:
        path, _ = QFileDialog.getOpenFileName(self, "Recording", "", "OpenNI recordings (*.oni)")
        if path:
            self.open_recording(Path(path))

    @Slot(object)
    def _on_opened(self, opened: Opened) -> None:
        self._opened = opened
        self.transport.set_source(opened.frames, live=opened.live)
        self.transport.set_playing(opened.live)
        self.watch.set_log(self.engine.log)
        self.training.set_source(opened)
        self.bar.set_exportable(self.model is not None)

    @Slot(object)
    def _on_failed(self, failure: TaskFailure) -> None:
        self.banner.show_failure(failure)
        if self._opened is None or self._opened.live:
            self._source_gone("No picture")

    def _source_gone(self, said: str) -> None:
        self._opened = None
        self.transport.set_source(0, live=False)
        self.card.say(said)
        self.status.clear()
        self.bar.set_source(None)
        self.bar.set_exportable(False)
        self.training.set_source(None)

    @Slot(object)
    def _tell_failure(self, failure: TaskFailure) -> None:
        self.banner.show_failure(told(failure))

    # --- frames ------------------------------------------------------------------------------------------

    @Slot()
    def _on_tick(self) -> None:
        tick = self.engine.take()
        if tick is None or self._closing or self._opened is None:
            return
        self.card.show_tick(tick, labelling=self.training.active)
        self.transport.show_place(tick.shot.number, tick.shot.time_s)
        self.status.show_tick(tick, has_model=self.model is not None, labelling=self.training.active)
        if self.training.active:
            self.training.show_tick(tick, playing=self.transport.playing)
        else:
            self.watch.show_tick(tick)

    def _unless_unsaved(self, act: Callable[[], None]) -> None:
        if self.training.may_leave(act):
            act()

    @Slot(bool)
    def _play(self, on: bool) -> None:
        self._unless_unsaved(lambda: self.engine.play(on))

    @Slot(int)
    def _step(self, by: int) -> None:
        if self.transport.forward.isEnabled():
            self._unless_unsaved(lambda: self.engine.step(by))

    @Slot(int)
    def _seek(self, number: int) -> None:
        self._unless_unsaved(lambda: self.engine.seek(number))
        shot = self.training.labelling.shot
        if self.training.active and self.training.labelling.unsaved and shot is not None:
            self.transport.show_place(shot.number, shot.time_s)

    @Slot()
    def _after_save(self) -> None:
        if self._opened is not None and self._opened.live:
            self.engine.play(True)
        else:
            self.engine.step(1)

    # --- modes and options -------------------------------------------------------------------------------

    @Slot(str)
    def _mode_asked(self, mode: str) -> None:
        self.bar.modes.set_chosen("train" if self.training.active else "watch")
        self._unless_unsaved(lambda: self._set_mode(mode))

    def _set_mode(self, mode: str) -> None:
        train = mode == "train"
        self.bar.modes.set_chosen(mode)
        self.watch.setVisible(not train)
        self.training.panel.setVisible(train)
        self.card.set_labelling(train)
        self.training.set_active(train)
        self.engine.set_labelling(train)

    @Slot()
    def _show_options(self) -> None:
        def accepted(settings: HandSettings) -> None:
            self.settings = settings
            self.engine.use(self.model, settings)

        sheet = OptionsSheet(self, self.settings, accepted)
        sheet.open(sheet.refinement)

    # --- the model ---------------------------------------------------------------------------------------

    def load_model(self, path: Path) -> None:
        """Read a model and use it."""
        self.files.load_model(path)

    def use_model(self, model: HandModel, name: str) -> None:
        """Track with a model from now on."""
        if self._closing:
            return
        self.model = model
        self.engine.use(model, self.settings)
        self.bar.show_model(model, name)
        self.training.panel.set_proposing(True)
        self.bar.set_exportable(self._opened is not None)
        self.watch.set_log(self.engine.log)
        self._set_mode("watch")

    @Slot()
    def _ask_export(self) -> None:
        if self.model is not None and self._opened is not None:
            self.files.ask_export(self.model, self.settings, self._path)

    # --- the end -----------------------------------------------------------------------------------------

    def closeEvent(self, event: QCloseEvent) -> None:  # noqa: D102
        if not self.training.may_leave(lambda: self.close()):
            event.ignore()
            return
        self._closing = True
        task = self.overlay.task
        if task is not None:
            task.cancel()
        self.engine.close()
        self.watch.view.close_view()
        super().closeEvent(event)
        self.closed.emit()
