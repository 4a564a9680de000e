"""Steps 1 and 2: the camera's picture, the camera and how the patient stands, and what was found."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import QSignalBlocker, QSize, Qt, Signal, Slot
from PySide6.QtGui import QIcon, QImage, QKeyEvent
from PySide6.QtWidgets import (
    QButtonGroup,
    QComboBox,
    QFileDialog,
    QFrame,
    QHBoxLayout,
    QLabel,
    QPushButton,
    QStackedLayout,
    QVBoxLayout,
    QWidget,
)

from app.theme import icon, palette, set_state, style_class
from app.widgets.live_strip import ReadingStrip
from app.widgets.live_view import LiveView
from app.widgets.photo_view import PhotoView
from app.windows.visit.camera_deck import CameraDeck
from app.windows.visit.joint_editor import JointEditor
from app.windows.visit.live_controls import AssistControls
from app.windows.visit.live_verdict import VerdictPanel
from app.windows.visit.pictures import joints_picture
from app.windows.visit.side_panel import BulletList, SidePanel, field_label, wrapped

if TYPE_CHECKING:
    from core.anchors import AnalysedCapture

VIEWS = ("front", "back", "left", "right")
TURNS = {
    "front": "Next: front. Ask the patient to face the camera.",
    "back": "Next: back. Ask the patient to turn round.",
    "left": "Next: left. The patient's left side to the camera.",
    "right": "Next: right. The patient's right side to the camera.",
}
STANCES = (
    ("A", "Arms a little out"),
    ("down", "Arms down"),
    ("T", "Arms out to the side"),
    ("psi", "Psi"),
    ("forward", "Arms forward"),
    ("up", "Arms up"),
    ("knee", "One knee raised"),
    ("twist", "Trunk turned"),
    ("sidebend", "Bent to the side"),
    ("hip_hands", "Hands on the hips"),
)


class CaptureScreen(QWidget):
    """One capture step.

    Parameters
    ----------
    name : {"stance", "capture"}
        Prefix of the object names.
    deck : CameraDeck
        Shared by both steps.

    Signals
    -------
    primary_clicked(), secondary_clicked()
        The filled button, and the plain one beside it.
    pose_changed()
        Another view or simulated stance was chosen.
    live_toggled()
        The camera's picture, or the capture, is to be shown.
    escaped()
        Esc was pressed.
    """

    primary_clicked = Signal()
    secondary_clicked = Signal()
    pose_changed = Signal()
    live_toggled = Signal()
    escaped = Signal()

    def __init__(self, name: str, deck: CameraDeck, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName(f"{name}_screen")
        self._name, self._deck = name, deck
        self._live = True
        self.photo = PhotoView()
        self.photo.setObjectName(f"{name}_photo")
        self.live_view = LiveView()
        self.live_view.setObjectName(f"{name}_live_view")
        self.strip = ReadingStrip(name)
        self.controls = AssistControls(name)
        self.verdict = VerdictPanel(name)
        self.joints = JointEditor(self.photo, name)
        self.joints.hide()
        self.caption = QLabel()
        self.caption.setObjectName(f"{name}_photo_caption")
        style_class(self.caption, "caption")
        self.live_button = QPushButton(icon("camera", palette.SECONDARY), " Live picture")
        self.live_button.setObjectName(f"{name}_live")
        self.live_button.setCheckable(True)
        style_class(self.live_button, "quiet")
        self.live_button.toggled.connect(lambda _: self.live_toggled.emit())
        self.panel = SidePanel(name)
        self.corrections = BulletList(f"{name}_corrections", "warning")
        self.warnings = BulletList(f"{name}_warnings", "info")
        self.secondary = self.panel.add_secondary("", f"{name}_secondary")
        self.secondary.clicked.connect(self.secondary_clicked)
        self.panel.primary.clicked.connect(self.primary_clicked)
        self._build_controls()
        self._build_layout()
        deck.changed.connect(self._on_camera)
        self._on_camera()

    # --- building ------------------------------------------------------------------------------------

    def _build_controls(self) -> None:
        self.camera_box = QComboBox()
        self.camera_box.setObjectName(f"{self._name}_camera")
        self.camera_box.activated.connect(self._on_camera_chosen)
        self.open_folder = self._tool("Open capture folder", "folder", "open_folder", self._ask_folder)
        self.open_recording = self._tool("Open recording", "play", "open_recording", self._ask_recording)
        self.views = QButtonGroup(self)
        self.view_row = QHBoxLayout()
        self.view_row.setSpacing(0)
        for i, view in enumerate(VIEWS):
            button = QPushButton(view.capitalize())
            button.setObjectName(f"{self._name}_view_{view}")
            button.setCheckable(True)
            button.setChecked(i == 0)
            style_class(button, "segment")
            set_state(button, "first", "true" if i == 0 else "false")
            set_state(button, "last", "true" if i == len(VIEWS) - 1 else "false")
            self.views.addButton(button, i)
            self.view_row.addWidget(button, 1)
        self.views.idClicked.connect(lambda _: self.pose_changed.emit())
        self.next_view = QPushButton()
        self.next_view.setObjectName(f"{self._name}_next_view")
        self.next_view.setIconSize(QSize(16, 16))
        style_class(self.next_view, "quiet")
        self.next_view.clicked.connect(self._go_to_next_view)
        self.next_view.hide()
        self._next = ""
        self.stance_box = QComboBox()
        self.stance_box.setObjectName(f"{self._name}_stance")
        for key, text in STANCES:
            self.stance_box.addItem(text, key)
        self.stance_box.currentIndexChanged.connect(lambda _: self.pose_changed.emit())
        self.stance_label = field_label("Stance of the simulated patient")

    def _tool(self, text: str, symbol: str, name: str, act: Callable[[], None]) -> QPushButton:
        button = QPushButton(icon(symbol, palette.SECONDARY), f" {text}")
        button.setObjectName(f"{self._name}_{name}")
        button.clicked.connect(act)
        return button

    def _build_layout(self) -> None:
        frame = QFrame()
        style_class(frame, "photo")
        inside = QVBoxLayout(frame)
        inside.setContentsMargins(1, 1, 1, 1)
        self._pictures = QStackedLayout()
        self._pictures.addWidget(self.live_view)
        self._pictures.addWidget(self.photo)
        inside.addLayout(self._pictures)
        left = QVBoxLayout()
        left.setSpacing(8)
        left.addWidget(frame, 1)
        left.addWidget(self.strip)
        left.addWidget(self.joints)
        below = QHBoxLayout()
        below.addWidget(self.caption, 1)
        below.addWidget(self.live_button)
        left.addLayout(below)
        body = self.panel.body
        body.addWidget(self.corrections)
        body.addWidget(self.verdict)
        self.camera_label = field_label("Camera")
        body.addWidget(self.camera_label)
        body.addWidget(self.camera_box)
        self.calibration = wrapped("", "caption", f"{self._name}_calibration")
        body.addWidget(self.calibration)
        files = QHBoxLayout()
        files.setSpacing(8)
        files.addWidget(self.open_folder, 1)
        files.addWidget(self.open_recording, 1)
        body.addLayout(files)
        self.view_label = field_label("Side of the body in the picture")
        body.addSpacing(4)
        body.addWidget(self.view_label)
        body.addLayout(self.view_row)
        body.addWidget(self.next_view)
        body.addSpacing(4)
        body.addWidget(self.stance_label)
        body.addWidget(self.stance_box)
        body.addWidget(self.controls)
        body.addWidget(self.warnings)
        body.addStretch(1)
        row = QHBoxLayout(self)
        row.setContentsMargins(24, 16, 24, 24)
        row.setSpacing(16)
        row.addLayout(left, 1)
        row.addWidget(self.panel)

    # --- what is shown -------------------------------------------------------------------------------

    def set_choices_visible(self, *, view: bool) -> None:
        """Whether this step asks which side of the body is in the picture."""
        for button in self.views.buttons():
            button.setVisible(view)
        self.view_label.setVisible(view)

    def show_taken(self, views: tuple[str, ...]) -> None:
        """Mark the sides that are captured already."""
        for i, view in enumerate(VIEWS):
            self.views.button(i).setIcon(icon("check", palette.GREEN) if view in views else QIcon())
        left = [view for view in VIEWS if view not in views]
        self._next = left[0] if left and views and self.view_label.isVisibleTo(self) else ""
        self.next_view.setVisible(bool(self._next) and self._next != self.view)
        if self._next:
            self.next_view.setIcon(icon("next", palette.ACCENT))
            self.next_view.setText(f" {TURNS[self._next]}")

    @Slot()
    def _go_to_next_view(self) -> None:
        if self._next:
            self.set_view(self._next)
            self.pose_changed.emit()

    def offer_live(self, on: bool) -> None:
        """Whether the user may look through the camera although there is a capture to show."""
        self.live_button.setVisible(on)
        if not on:
            self.stop_live()

    def stop_live(self) -> None:
        """Prefer the capture to the camera's picture again."""
        with QSignalBlocker(self.live_button):
            self.live_button.setChecked(False)

    @property
    def live_wanted(self) -> bool:
        """Whether the user asked for the camera's picture."""
        return self.live_button.isChecked()

    @property
    def view(self) -> str:
        """The side chosen."""
        return VIEWS[max(self.views.checkedId(), 0)]

    def set_view(self, view: str) -> None:
        """Choose a side without telling."""
        if view in VIEWS:
            self.views.button(VIEWS.index(view)).setChecked(True)

    @property
    def stance(self) -> str:
        """The simulated patient's stance chosen."""
        return str(self.stance_box.currentData())

    def set_stance(self, stance: str) -> None:
        """Choose a simulated stance without telling."""
        with QSignalBlocker(self.stance_box):
            self.stance_box.setCurrentIndex(self.stance_box.findData(stance))

    def show_preview(self) -> None:
        """Show what the camera sees."""
        self._live = True
        self._pictures.setCurrentWidget(self.live_view)
        self.joints.set_capture(None)
        self.joints.hide()
        self._on_camera()

    def _show_photo(self) -> None:
        self._live = False
        self._pictures.setCurrentWidget(self.photo)
        self.strip.hide()
        self.controls.hide()
        self.joints.hide()

    def keyPressEvent(self, event: QKeyEvent) -> None:  # noqa: D102
        if event.key() == Qt.Key.Key_Escape:
            self.escaped.emit()
        else:
            super().keyPressEvent(event)

    def show_unsaved(self, analysed: AnalysedCapture, picture: QImage, caption: str) -> None:
        """Show a capture that is not stored yet; its joints can be corrected by hand."""
        self._show_photo()
        self.joints.set_capture(analysed)
        self.joints.show()
        self.photo.set_image(picture)
        self.caption.setText(caption)

    def show_capture(self, analysed: AnalysedCapture | None, caption: str) -> None:
        """Show a capture with its joints instead of the camera's picture."""
        self._show_photo()
        self.photo.set_image(None if analysed is None else joints_picture(analysed))
        self.caption.setText(caption)

    def show_plain(self, image: QImage, caption: str) -> None:
        """Show a stored picture whose analysis is not in memory."""
        self._show_photo()
        self.photo.set_image(image)
        self.caption.setText(caption)

    @property
    def live(self) -> bool:
        """Whether the camera's picture is shown."""
        return self._live

    # --- the camera ----------------------------------------------------------------------------------

    def refresh_cameras(self) -> None:
        """List the cameras there are now."""
        with QSignalBlocker(self.camera_box):
            self.camera_box.clear()
            for info in self._deck.choices():
                self.camera_box.addItem(info.name, info.id)
            if not self.camera_box.count():
                self.camera_box.addItem("No camera is connected", "")
        self._on_camera()

    @Slot()
    def _on_camera(self) -> None:
        deck = self._deck
        with QSignalBlocker(self.camera_box):
            index = self.camera_box.findData(deck.camera_id)
            if deck.camera_id and index < 0:
                self.camera_box.addItem(_recording_name(deck.camera_id), deck.camera_id)
                index = self.camera_box.count() - 1
            self.camera_box.setCurrentIndex(index)
        simulated = deck.is_simulator
        self.stance_label.setVisible(simulated)
        self.stance_box.setVisible(simulated)
        self.calibration.setText(deck.calibration)
        self.calibration.setVisible(bool(deck.calibration))
        live = self._live and deck.is_live
        self.strip.setVisible(live)
        self.controls.setVisible(live)
        if self._live:
            if deck.camera is None:
                self.live_view.show_picture(None)
                self.strip.show_guidance(None)
            opening = bool(deck.camera_id) and deck.camera is None
            notice = "Opening the camera." if opening else "Choose a camera or open a recording."
            if deck.camera is not None:
                notice = "Waiting for the first picture."
            if self.live_view.image_size == (0, 0):
                self.live_view.set_notice(notice)
            self.caption.setText("" if deck.camera is not None else notice)

    @Slot(int)
    def _on_camera_chosen(self, index: int) -> None:
        camera_id = self.camera_box.itemData(index)
        if camera_id:
            self._deck.choose(str(camera_id))

    @Slot()
    def _ask_folder(self) -> None:
        folder = QFileDialog.getExistingDirectory(self, "Open a capture folder")
        if folder:
            self._deck.choose_path(Path(folder))

    @Slot()
    def _ask_recording(self) -> None:
        path, _ = QFileDialog.getOpenFileName(self, "Open a recording", "", "Recordings (*.oni *.bag *.db3)")
        if path:
            self._deck.choose_path(Path(path))


def _recording_name(camera_id: str) -> str:
    kind, _, address = camera_id.partition(":")
    name = Path(address).name
    return (
        f"Recording {name}" if kind == "recording" else f"Capture folder {name}" if kind == "folder" else name
    )
