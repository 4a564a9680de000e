"""What happens while training: clicks to points, points to files, files to a model."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import QObject, Qt, Signal, Slot
from PySide6.QtWidgets import QFileDialog, QWidget

from app.tasks import TaskFailure, TaskRunner
from app.widgets.hand_picture import HandPicture
from app.widgets.status import MessageBanner, ProgressOverlay
from app.windows.hand.engine import HandEngine
from app.windows.hand.lesson_sheet import LessonSheet
from app.windows.hand.ticks import Opened, Tick, told
from app.windows.hand.train_panel import TrainPanel
from app.workflows.hand_dataset import HandDataset
from app.workflows.hand_labelling import Labelling
from app.workflows.hand_rows import HandShot
from app.workflows.hand_settings import HandSettings
from core.errors import GeodermError, InputError
from core.hand.dataset import configuration_name, read_labels

if TYPE_CHECKING:
    from core.hand.answer import HandAnswer
    from core.hand.hand_model import HandModel
    from core.hand.learning import Lesson
    from core.progress import Progress

SaveModel = Callable[["HandModel"], None]
UseModel = Callable[["HandModel", str], None]


class Training(QObject):
    """The training side of the window.

    Parameters
    ----------
    window : QWidget
    tasks : TaskRunner
    engine : HandEngine
    picture : HandPicture
    banner : MessageBanner
    overlay : ProgressOverlay
    use, save : callable
        Take a learned model into use; write it to a file.
    settings : callable
        The settings in force.

    Signals
    -------
    saved()
        A frame's labels were stored.
    """

    saved = Signal()
    _proposed = Signal(object, object)

    def __init__(
        self,
        window: QWidget,
        tasks: TaskRunner,
        engine: HandEngine,
        picture: HandPicture,
        banner: MessageBanner,
        overlay: ProgressOverlay,
        *,
        use: UseModel,
        save: SaveModel,
        settings: Callable[[], HandSettings],
    ) -> None:
        super().__init__(window)
        self._window, self._tasks, self._engine = window, tasks, engine
        self._picture, self._banner, self._overlay = picture, banner, overlay
        self._use, self._save_model, self._settings = use, save, settings
        self.labelling = Labelling()
        self.panel = TrainPanel(self.labelling)
        self.dataset: HandDataset | None = None
        self.active = False
        self._source_folder: Path | None = None
        self._last_name = ""
        self._pending: Callable[[], None] | None = None
        self.labelling.changed.connect(self._show_labels)
        self.panel.save_asked.connect(self.save)
        self.panel.propose_asked.connect(self.propose)
        self.panel.learn_asked.connect(self.learn)
        self.panel.dataset_asked.connect(self.choose_folder)
        picture.placed.connect(self._on_click)
        picture.point_moved.connect(self._on_moved)
        picture.point_chosen.connect(self.labelling.select)
        banner.action_triggered.connect(self._on_action)
        self._proposed.connect(self._on_proposed, Qt.ConnectionType.QueuedConnection)

    # --- source and mode ---------------------------------------------------------------------------------

    def set_source(self, opened: Opened | None) -> None:
        """Another source: a folder of captures is its own dataset, and nobody else's."""
        if self.dataset is not None and self.dataset.folder == self._source_folder:
            self.dataset = None
        self._source_folder = None if opened is None else opened.folder
        if self._source_folder is not None:
            self.dataset = HandDataset(self._source_folder)
        self.labelling.begin(None)
        self.refresh_counts()

    def set_active(self, on: bool) -> None:
        """Whether training is shown."""
        self.active = on
        self._picture.set_labelling(on)
        if on:
            self.refresh_counts()
        else:
            self.labelling.begin(None)

    def show_tick(self, tick: Tick, *, playing: bool) -> None:
        """Another frame, or the same one with its skin."""
        if tick.live and playing:
            if self.labelling.shot is not None:
                self.labelling.begin(None)
            return
        if self.labelling.shot is not tick.shot:
            self._begin(tick.shot)
        if tick.skin is not None:
            self.labelling.set_skin(tick.skin)

    def _begin(self, shot: HandShot) -> None:
        labels = None
        try:
            labels = None if shot.folder is None else read_labels(shot.folder)
        except GeodermError as error:
            self._banner.show_error(error.message, "Its points were left alone; saving replaces the file.")
        self.panel.stored_name = "" if labels is None else labels.configuration or ""
        self.labelling.begin(shot, labels)
        if labels is not None and labels.configuration is not None:
            self.panel.set_name(labels.configuration)
        elif not self.panel.name():
            self.panel.set_name(self._last_name)

    def may_leave(self, go: Callable[[], None]) -> bool:
        """Whether the frame can be left; if its points are not saved, asks, and does ``go`` later."""
        if not (self.active and self.labelling.unsaved):
            return True
        self._pending = go
        self._banner.show_warning(
            "The points of this frame are not saved.",
            "",
            [("hand_save", "Save"), ("hand_discard", "Discard")],
        )
        return False

    @Slot(str)
    def _on_action(self, key: str) -> None:
        if key not in ("hand_save", "hand_discard"):
            return
        pending, self._pending = self._pending, None
        self._banner.clear()
        if key == "hand_save" and not self._store():
            return
        if key == "hand_discard":
            self.labelling.begin(None)
        if pending is not None:
            pending()

    @Slot(object)
    def _tell_failure(self, failure: TaskFailure) -> None:
        self._banner.show_failure(told(failure))

    # --- points ------------------------------------------------------------------------------------------

    def _show_labels(self) -> None:
        if self.active:
            lab = self.labelling
            self._picture.show_labels(lab.pixels(), lab.proposed, lab.current)

    @Slot(float, float)
    def _on_click(self, u: float, v: float) -> None:
        if self.active:
            self._tell(self.labelling.place(u, v))

    @Slot(str, float, float)
    def _on_moved(self, name: str, u: float, v: float) -> None:
        self._tell(self.labelling.move(name, u, v))

    def _tell(self, refused: str) -> None:
        """Beside the list and not in the banner, which would push the picture from under the mouse."""
        if refused:
            self.panel.warn(refused)

    @Slot()
    def propose(self) -> None:
        """Take over what the model in use finds."""
        shot = self.labelling.shot
        if shot is not None:
            self._engine.track_once(shot, lambda answer: self._proposed.emit(shot, answer))

    @Slot(object, object)
    def _on_proposed(self, shot: HandShot, answer: HandAnswer) -> None:
        if self.labelling.shot is not shot:
            return
        count = self.labelling.propose(answer)
        if count:
            if answer.configuration and not self.panel.stored_name:
                self.panel.set_name(answer.configuration)
        else:
            self.panel.warn(f"The model finds no further point here. {answer.reason or ''}".strip())

    # --- files -------------------------------------------------------------------------------------------

    @Slot()
    def save(self) -> None:
        """Store the frame's labels and go on."""
        if self._store():
            self.saved.emit()

    def _store(self) -> bool:
        shot = self.labelling.shot
        if shot is None:
            return False
        try:
            name = configuration_name(self.panel.name())
        except InputError as error:
            self.panel.field.set_error(str(error))
            self.panel.configuration.setFocus()
            return False
        if self.dataset is None and not self._ask_folder():
            return False
        assert self.dataset is not None
        try:
            folder = self.dataset.store(shot, self.labelling.labels(name))
        except GeodermError as error:
            self._banner.show_error(error.message, error.advice)
            return False
        self._last_name = self.panel.stored_name = name
        self.labelling.stored()
        self.refresh_counts(f"Saved as {folder.name}")
        return True

    @Slot()
    def choose_folder(self) -> None:
        """Ask for the folder of live frames."""
        if self._ask_folder():
            self.refresh_counts()

    def _ask_folder(self) -> bool:
        path = QFileDialog.getExistingDirectory(self._window, "Folder for labelled frames")
        if not path:
            return False
        self.dataset = HandDataset(Path(path))
        return True

    def refresh_counts(self, saved: str = "") -> None:
        """Show what the dataset holds, and what was saved just now."""
        counts: dict[str, int] | None = None
        if self.dataset is not None:
            try:
                counts = self.dataset.counts()
            except GeodermError as error:
                self._banner.show_error(error.message, error.advice)
                counts = {}
        title = "No folder chosen" if self.dataset is None else saved or "Labelled frames"
        self.panel.set_counts(title, counts, can_choose=self._source_folder is None)

    # --- learning ----------------------------------------------------------------------------------------

    @Slot()
    def learn(self) -> None:
        """Learn from the labelled frames."""
        dataset, settings = self.dataset, self._settings()
        if dataset is None:
            return
        self._engine.play(False)

        def work(progress: Progress) -> Lesson:
            detector = None
            if settings.anchors == "palm":
                from devices.trackers.mediapipe_hands import MediaPipeHands

                detector = MediaPipeHands()
            try:
                return dataset.learn(settings, progress, detector)
            finally:
                if detector is not None:
                    detector.close()

        task = self._tasks.start("Learning the hand", work)
        self._overlay.attach(task)
        task.finished.connect(self._on_learned)
        task.failed.connect(self._tell_failure)
        task.cancelled.connect(self._on_stopped)

    @Slot()
    def _on_stopped(self) -> None:
        self._banner.show_info("Learning was stopped. Nothing was changed.")

    @Slot(object)
    def _on_learned(self, lesson: Lesson) -> None:
        sheet = LessonSheet(
            self._window,
            lesson,
            lambda: self._save_model(lesson.model),
            lambda: (sheet.close_sheet(), self._use(lesson.model, "just learned")),
        )
        sheet.open()
