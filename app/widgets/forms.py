"""Form fields: a label above, the field, and what is wrong with it below."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QLabel, QLineEdit, QVBoxLayout, QWidget

from app.theme import set_state, style_class


class Field(QWidget):
    """A labelled field with room for an error message.

    Parameters
    ----------
    label : str
    editor : QWidget
        A line edit, combo box or other editor.
    hint : str
        Shown small under the field while nothing is wrong.
    """

    def __init__(self, label: str, editor: QWidget, hint: str = "", parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.editor = editor
        self._hint = hint
        caption = QLabel(label)
        caption.setBuddy(editor)
        style_class(caption, "field")
        self._below = QLabel(hint)
        self._below.setWordWrap(True)
        self._below.setAlignment(Qt.AlignmentFlag.AlignTop)
        style_class(self._below, "caption")
        self._below.setVisible(bool(hint))
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(4)
        column.addWidget(caption)
        column.addWidget(editor)
        column.addWidget(self._below)
        column.addStretch(1)
        if isinstance(editor, QLineEdit):
            editor.textEdited.connect(self._on_edited)

    def _on_edited(self) -> None:
        self.set_error("")

    def set_error(self, message: str) -> None:
        """Mark the field as wrong and say why; an empty message takes it back."""
        set_state(self.editor, "invalid", "true" if message else "false")
        self._below.setText(message or self._hint)
        style_class(self._below, "field-error" if message else "caption")
        self._below.setObjectName(f"{self.editor.objectName()}_error" if message else "")
        self._below.setVisible(bool(message or self._hint))

    def error(self) -> str:
        """What is wrong, empty if nothing is."""
        return self._below.text() if self._below.property("class") == "field-error" else ""


def line_edit(object_name: str, placeholder: str = "", *, secret: bool = False) -> QLineEdit:
    """A line edit with a stable name."""
    edit = QLineEdit()
    edit.setObjectName(object_name)
    edit.setPlaceholderText(placeholder)
    if secret:
        edit.setEchoMode(QLineEdit.EchoMode.Password)
    return edit
