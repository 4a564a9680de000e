"""Icons: one-colour line drawings from ``resources/icons``, tinted when loaded."""

from __future__ import annotations

from functools import lru_cache

from PySide6.QtCore import QByteArray, QRectF, QSize, Qt
from PySide6.QtGui import QIcon, QImage, QPainter, QPixmap
from PySide6.QtSvg import QSvgRenderer

from app.theme import palette
from resources import resource_path

_DRAWN_COLOR = "#17242B"


@lru_cache(maxsize=256)
def _image(name: str, color: str, size: int) -> QImage:
    svg = resource_path("icons", f"{name}.svg").read_text(encoding="utf-8").replace(_DRAWN_COLOR, color)
    renderer = QSvgRenderer(QByteArray(svg.encode()))
    image = QImage(size, size, QImage.Format.Format_ARGB32_Premultiplied)
    image.fill(Qt.GlobalColor.transparent)
    painter = QPainter(image)
    renderer.render(painter, QRectF(0, 0, size, size))
    painter.end()
    return image


def icon_pixmap(name: str, size: int = 20, color: str = palette.TEXT, ratio: float = 2.0) -> QPixmap:
    """A pixmap ``size`` logical pixels wide, drawn at ``ratio`` device pixels per logical one."""
    pixmap = QPixmap.fromImage(_image(name, color, round(size * ratio)))
    pixmap.setDevicePixelRatio(ratio)
    return pixmap


def icon(name: str, color: str = palette.TEXT, disabled: str = palette.BORDER_STRONG) -> QIcon:
    """Icon ``resources/icons/<name>.svg`` in ``color``, and in ``disabled`` where its widget is disabled.

    Raises
    ------
    FileNotFoundError
        If there is no such icon.
    """
    result = QIcon()
    for size in (16, 20, 24, 32, 48):
        result.addPixmap(QPixmap.fromImage(_image(name, color, size)), QIcon.Mode.Normal)
        result.addPixmap(QPixmap.fromImage(_image(name, disabled, size)), QIcon.Mode.Disabled)
    return result


ICON_SIZE = QSize(20, 20)
