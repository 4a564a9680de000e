"""The bar above: where frames come from, watch or train, the model in use, export, options."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from PySide6.QtCore import Qt, Signal, Slot
from PySide6.QtWidgets import QComboBox, QFrame, QHBoxLayout, QLabel, QSizePolicy, QVBoxLayout, QWidget

from app.theme import style_class
from app.windows.hand.parts import Segments, push, tool

if TYPE_CHECKING:
    from core.hand.hand_model import HandModel
    from devices.camera import DeviceInfo

_NO_HANDS = ("simulator:", "simulator-board:")
"""Simulated patients and boards hold no marked hand before the camera."""

_CHOOSE, _NONE = "Live camera", "No live camera found"


class SourceBar(QFrame):
    """See the module's documentation.

    Signals
    -------
    camera_chosen(str), folder_asked(), oni_asked(), mode_chosen(str), model_asked(), export_asked(),
    options_asked(), look_again()
    """

    camera_chosen = Signal(str)
    folder_asked = Signal()
    oni_asked = Signal()
    mode_chosen = Signal(str)
    model_asked = Signal()
    export_asked = Signal()
    options_asked = Signal()
    look_again = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        style_class(self, "bar")
        self.cameras = QComboBox()
        self.cameras.setObjectName("hand_camera")
        self.cameras.setAccessibleName("Live camera")
        self.cameras.addItem(_CHOOSE, "")
        self.cameras.setFixedWidth(210)
        self.cameras.setSizeAdjustPolicy(QComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon)
        self.cameras.activated.connect(self._on_camera)
        self.again = tool("hand_look_again", "refresh", "Look for cameras again", self.look_again.emit)
        self.folder = push(
            "hand_open_folder",
            "Sequence…",
            "secondary",
            self.folder_asked.emit,
            "Folder of captures (Ctrl+O)",
        )
        self.oni = push("hand_open_oni", ".oni…", "secondary", self.oni_asked.emit, "OpenNI recording")
        self.modes = Segments("hand_mode", (("watch", "Watch"), ("train", "Train")), self.mode_chosen.emit)
        self.modes.buttons["watch"].setToolTip("Ctrl+1")
        self.modes.buttons["train"].setToolTip("Ctrl+2")
        self.title = QLabel()
        self.title.setObjectName("hand_model")
        style_class(self.title, "strong")
        self.about = QLabel()
        self.about.setObjectName("hand_model_about")
        style_class(self.about, "caption")
        for label in (self.title, self.about):
            label.setTextFormat(Qt.TextFormat.PlainText)
            label.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Fixed)
        self.model = push("hand_open_model", "Model…", "secondary", self.model_asked.emit, "Use a model")
        self.export = push(
            "hand_export",
            "Export…",
            "secondary",
            self.export_asked.emit,
            "Track every frame into a file (Ctrl+E)",
        )
        self.export.setEnabled(False)
        self.options = tool("hand_options_open", "settings", "Options", self.options_asked.emit)
        words = QVBoxLayout()
        words.setSpacing(0)
        words.addStretch(1)
        words.addWidget(self.title)
        words.addWidget(self.about)
        words.addStretch(1)
        row = QHBoxLayout(self)
        row.setContentsMargins(12, 8, 12, 8)
        row.setSpacing(8)
        row.addWidget(self.cameras)
        row.addWidget(self.again)
        row.addWidget(self.folder)
        row.addWidget(self.oni)
        row.addSpacing(8)
        row.addWidget(self.modes)
        row.addSpacing(8)
        row.addLayout(words, 1)
        row.addWidget(self.model)
        row.addWidget(self.export)
        row.addWidget(self.options)

    @Slot(object)
    def set_cameras(self, cameras: Sequence[DeviceInfo]) -> None:
        """Which live cameras there are; the one in use stays chosen."""
        if self.cameras.view().isVisible():
            return
        cameras = [c for c in cameras if not c.id.startswith(_NO_HANDS)]
        chosen, words = self.cameras.currentData(), self.cameras.currentText()
        self.cameras.clear()
        self.cameras.addItem(_CHOOSE if cameras else _NONE, "")
        for camera in cameras:
            self.cameras.addItem(camera.name, camera.id)
            self.cameras.setItemData(self.cameras.count() - 1, camera.name, Qt.ItemDataRole.ToolTipRole)
        if chosen and self.cameras.findData(chosen) < 0:
            self.cameras.addItem(words, chosen)
        self.cameras.setCurrentIndex(max(self.cameras.findData(chosen), 0))

    @Slot(int)
    def _on_camera(self, row: int) -> None:
        camera_id = self.cameras.itemData(row)
        if camera_id:
            self.camera_chosen.emit(camera_id)

    def set_source(self, recording: str | None, camera_id: str = "") -> None:
        """What is shown: a recording by its name, or a camera."""
        if camera_id and self.cameras.findData(camera_id) < 0:
            self.cameras.addItem("Other camera", camera_id)
        self.cameras.setCurrentIndex(max(self.cameras.findData(camera_id), 0))
        self.folder.setToolTip("Folder of captures (Ctrl+O)" if recording is None else f"Shown: {recording}")

    def set_exportable(self, on: bool) -> None:
        """Whether there is something to export."""
        self.export.setEnabled(on)

    def show_model(self, model: HandModel | None, name: str) -> None:
        """The model in use."""
        if model is None:
            title, about = "No model", "Open one, or train one"
        else:
            title = ", ".join(model.configurations)
            marker = f"marker {1000 * model.marker_m:.0f} mm" if model.anchors == "marker" else "palm"
            about = f"{name}, {marker}" if name else marker
        for label, text in ((self.title, title), (self.about, about)):
            label.setText(text)
            label.setToolTip(text)
