"""The switches of the assistant: capture when still, and the outline of an earlier view."""

from __future__ import annotations

from PySide6.QtCore import QSignalBlocker, Qt, Signal
from PySide6.QtWidgets import QCheckBox, QHBoxLayout, QSlider, QVBoxLayout, QWidget

USUAL_OPACITY = 70


class AssistControls(QWidget):
    """Shown while the camera sees the present.

    Parameters
    ----------
    name : str
        Prefix of the object names: ``<name>_auto``, ``<name>_ghost``, ``<name>_ghost_opacity``.

    Signals
    -------
    automatic_toggled(bool)
    ghost_changed()
    """

    automatic_toggled = Signal(bool)
    ghost_changed = Signal()

    def __init__(self, name: str, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName(f"{name}_assist")
        self.automatic = QCheckBox("Capture when still")
        self.automatic.setObjectName(f"{name}_auto")
        self.automatic.setToolTip(
            "When the patient stands well and holds still, the countdown begins by itself. Esc stops it."
        )
        self.automatic.toggled.connect(self.automatic_toggled)
        self.ghost = QCheckBox()
        self.ghost.setObjectName(f"{name}_ghost")
        self.ghost.setChecked(True)
        self.ghost.toggled.connect(self._on_ghost)
        self.opacity = QSlider(Qt.Orientation.Horizontal)
        self.opacity.setObjectName(f"{name}_ghost_opacity")
        self.opacity.setRange(10, 100)
        self.opacity.setValue(USUAL_OPACITY)
        self.opacity.setFixedWidth(120)
        self.opacity.setToolTip("How strongly the outline is drawn")
        self.opacity.valueChanged.connect(lambda _: self.ghost_changed.emit())
        row = QHBoxLayout()
        row.setSpacing(12)
        row.addWidget(self.ghost)
        row.addStretch(1)
        row.addWidget(self.opacity)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(4)
        column.addWidget(self.automatic, 0, Qt.AlignmentFlag.AlignLeft)
        column.addLayout(row)
        self.offer_ghost("")

    def _on_ghost(self, on: bool) -> None:
        self.opacity.setEnabled(on)
        self.ghost_changed.emit()

    def offer_ghost(self, text: str) -> None:
        """Offer an outline, named; empty for none."""
        if text:
            self.ghost.setText(text)
        self.ghost.setVisible(bool(text))
        self.opacity.setVisible(bool(text))

    @property
    def ghost_opacity(self) -> float:
        """0..1; 0 if the outline is switched off."""
        return self.opacity.value() / 100.0 if self.ghost.isChecked() else 0.0

    def set_automatic(self, on: bool) -> None:
        """Show whether captures are taken by themselves, without telling."""
        with QSignalBlocker(self.automatic):
            self.automatic.setChecked(on)
