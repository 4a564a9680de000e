"""The verdict of a capture that is not plainly good: what is missing, in a picture and in sentences."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np
from PySide6.QtCore import Qt
from PySide6.QtGui import QColor, QImage, QPainter, QPixmap
from PySide6.QtWidgets import QFrame, QHBoxLayout, QLabel, QVBoxLayout, QWidget

from app.theme import style_class
from app.windows.visit.pictures import joints_picture
from app.windows.visit.side_panel import wrapped

if TYPE_CHECKING:
    from core.anchors import AnalysedCapture
    from core.guidance import CaptureQuality

FAULT_COLORS: Final = {
    "no depth": "#E4572E",
    "blurred": "#A64AC9",
    "over-exposed": "#F2C230",
    "outside": "#2F7DE1",
}
FAULT_WORDS: Final = {
    "no depth": "No depth",
    "blurred": "Blurred",
    "over-exposed": "Too bright",
    "outside": "Cut off",
}
TITLES: Final = {
    "good": "A good capture",
    "usable": "Usable, with doubts",
    "refused": "This capture cannot be used",
}
_KINDS: Final = {"good": "success", "usable": "warning", "refused": "error"}
_TINT: Final = 165


class VerdictPanel(QFrame):
    """Grade, sentences, and what the colours in the picture mean; hidden while there is no verdict.

    Parameters
    ----------
    name : str
        Prefix of the object names: ``<name>_verdict``, ``<name>_verdict_title``, ``<name>_verdict_text``.
    """

    def __init__(self, name: str, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName(f"{name}_verdict")
        self._title = wrapped("", "strong", f"{name}_verdict_title")
        self._text = wrapped("", "", f"{name}_verdict_text")
        self._legend = QHBoxLayout()
        self._legend.setSpacing(16)
        column = QVBoxLayout(self)
        column.setContentsMargins(16, 12, 16, 12)
        column.setSpacing(6)
        column.addWidget(self._title)
        column.addWidget(self._text)
        column.addLayout(self._legend)
        self.hide()

    def show_quality(self, quality: CaptureQuality | None, sentences: tuple[str, ...] = ()) -> None:
        """Show a verdict with sentences; None for none."""
        if quality is None:
            self.hide()
            return
        style_class(self, f"banner-{_KINDS[quality.grade]}")
        self._title.setText(TITLES[quality.grade])
        self._text.setText("\n".join(f"•  {sentence}" for sentence in sentences))
        self._text.setVisible(bool(sentences))
        while (item := self._legend.takeAt(0)) is not None:
            if item.widget() is not None:
                item.widget().deleteLater()
        for fault in quality.shown_faults:
            swatch = QPixmap(14, 14)
            swatch.fill(QColor(FAULT_COLORS[fault]))
            box = QLabel()
            box.setPixmap(swatch)
            said = QLabel(FAULT_WORDS[fault])
            style_class(said, "caption")
            pair = QWidget()
            row = QHBoxLayout(pair)
            row.setContentsMargins(0, 0, 0, 0)
            row.setSpacing(6)
            row.addWidget(box)
            row.addWidget(said)
            self._legend.addWidget(pair)
        self._legend.addStretch(1)
        self.show()

    def text(self) -> str:
        """Title and sentences as shown; empty while hidden."""
        if not self.isVisibleTo(self.parentWidget()):
            return ""
        return f"{self._title.text()}\n{self._text.text()}"


def verdict_picture(analysed: AnalysedCapture, quality: CaptureQuality) -> QImage:
    """The capture with its joints, and a tint over what is missing."""
    picture = joints_picture(analysed)
    faults = quality.faults
    if not faults.any():
        return picture
    tint = np.zeros((*faults.shape, 4), np.uint8)
    for label, name in enumerate(FAULT_COLORS, start=1):
        color = QColor(FAULT_COLORS[name])
        tint[faults == label] = (color.red(), color.green(), color.blue(), _TINT)
    height, width = faults.shape
    layer = QImage(tint.data, width, height, tint.strides[0], QImage.Format.Format_RGBA8888)
    painter = QPainter(picture)
    painter.drawImage(
        picture.rect(),
        layer.scaled(
            picture.size(), Qt.AspectRatioMode.IgnoreAspectRatio, Qt.TransformationMode.SmoothTransformation
        ),
    )
    painter.end()
    return picture
