"""Models and tracks to and from files, with the dialogs that ask for them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import QObject, Slot
from PySide6.QtWidgets import QFileDialog, QWidget

from app.tasks import TaskFailure, TaskRunner
from app.widgets.status import MessageBanner, ProgressOverlay
from app.windows.hand.engine import HandEngine, open_follower
from app.windows.hand.ticks import told
from app.workflows.hand_export import FORMS, Exported, track_all, write_answers
from app.workflows.hand_settings import HandSettings

if TYPE_CHECKING:
    from core.hand.hand_model import HandModel
    from core.progress import Progress

_MODELS = "Hand models (*.json)"


class HandFiles(QObject):
    """See the module's documentation.

    Parameters
    ----------
    window : QWidget
    tasks : TaskRunner
    engine : HandEngine
    banner : MessageBanner
    overlay : ProgressOverlay
    use : callable
        Takes a model and its name into use.
    """

    def __init__(
        self,
        window: QWidget,
        tasks: TaskRunner,
        engine: HandEngine,
        banner: MessageBanner,
        overlay: ProgressOverlay,
        *,
        use: Callable[[HandModel, str], None],
    ) -> None:
        super().__init__(window)
        self._window, self._tasks, self._engine = window, tasks, engine
        self._banner, self._overlay, self._use = banner, overlay, use

    @Slot(object)
    def _tell_failure(self, failure: TaskFailure) -> None:
        self._banner.show_failure(told(failure))

    # --- models ------------------------------------------------------------------------------------------

    @Slot()
    def ask_model(self) -> None:
        """Ask which model to use."""
        path, _ = QFileDialog.getOpenFileName(self._window, "Model of a hand", "", _MODELS)
        if path:
            self.load_model(Path(path))

    def load_model(self, path: Path) -> None:
        """Read a model and use it."""

        def work(progress: Progress) -> tuple[HandModel, str]:
            from core.hand.model_file import read_model

            return read_model(path), path.name

        task = self._tasks.start("Reading the model", work, cancellable=False)
        task.finished.connect(self._on_read)
        task.failed.connect(self._tell_failure)

    @Slot(object)
    def _on_read(self, read: tuple[HandModel, str]) -> None:
        self._use(*read)

    def save_model(self, model: HandModel) -> None:
        """Ask where to, and write a model."""
        path, _ = QFileDialog.getSaveFileName(self._window, "Save the model", "hand-model.json", _MODELS)
        if not path:
            return
        target = Path(path if path.lower().endswith(".json") else f"{path}.json")

        def work(progress: Progress) -> Path:
            from core.hand.model_file import write_model

            write_model(target, model)
            return target

        task = self._tasks.start("Saving the model", work, cancellable=False)
        task.finished.connect(self._on_saved)
        task.failed.connect(self._tell_failure)

    @Slot(object)
    def _on_saved(self, target: Path) -> None:
        self._banner.show_success(f"The model was saved as {target.name}.")

    # --- tracks ------------------------------------------------------------------------------------------

    def ask_export(self, model: HandModel, settings: HandSettings, recording: Path | None) -> None:
        """Ask where to, and export."""
        path, chosen = QFileDialog.getSaveFileName(
            self._window, "Export the tracked points", "tracks.json", "Tracks (*.json);;Table (*.csv)"
        )
        if not path:
            return
        target = Path(path)
        if target.suffix.lower() not in FORMS:
            target = target.with_name(target.name + (".csv" if "csv" in chosen else ".json"))
        self.export(target, model, settings, recording)

    def export(self, target: Path, model: HandModel, settings: HandSettings, recording: Path | None) -> None:
        """Track every frame of a recording into a file; of a live camera, what was tracked of late."""
        self._engine.play(False)
        logged = [(frame.name, frame.answer) for frame in self._engine.log.frames()]

        def work(progress: Progress) -> Exported:
            if recording is None:
                return write_answers(target, logged)
            detector = open_follower() if model.anchors == "palm" else None
            try:
                return write_answers(target, track_all(recording, model, settings, progress, detector))
            finally:
                if detector is not None:
                    detector.close()

        task = self._tasks.start("Tracking every frame", work)
        self._overlay.attach(task)
        task.finished.connect(self._on_exported)
        task.failed.connect(self._tell_failure)
        task.cancelled.connect(lambda: self._banner.show_info("The export was stopped. Nothing was written."))

    @Slot(object)
    def _on_exported(self, done: Exported) -> None:
        self._banner.show_success(
            f"{done.frames} frames exported as {done.paths[0].name}.",
            f"A hand was found in {done.with_hand} of them.",
        )

    @Slot()
    def _on_stopped(self) -> None:
        self._banner.show_info("The export was stopped. Nothing was written.")
