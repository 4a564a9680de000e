"""Signing in; at the first start, creating the user whose name is stored with every decision."""

from __future__ import annotations

from PySide6.QtCore import Qt, Signal, Slot
from PySide6.QtWidgets import QFrame, QHBoxLayout, QLabel, QPushButton, QVBoxLayout, QWidget

from app.context import AppContext
from app.theme import icon_pixmap, palette, style_class
from app.widgets.forms import Field, line_edit
from core.errors import GeodermError
from core.records import User

_CARD_WIDTH = 420


class LoginPage(QWidget):
    """A card in the middle of the window.

    Signals
    -------
    logged_in()
        The context has a user now.
    """

    logged_in = Signal()

    def __init__(self, context: AppContext, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("login_page")
        style_class(self, "page")
        self._context = context
        self.title = QLabel()
        style_class(self.title, "title")
        self.text = QLabel()
        self.text.setWordWrap(True)
        style_class(self.text, "secondary")
        self.display_name = Field("Your name, as reports print it", line_edit("login_display_name"))
        self.username = Field("User name", line_edit("login_username"))
        self.password = Field("Password", line_edit("login_password", secret=True))
        self.repeated = Field("Password once more", line_edit("login_repeat", secret=True))
        self.problem = QLabel()
        self.problem.setObjectName("login_error")
        self.problem.setWordWrap(True)
        style_class(self.problem, "field-error")
        self.submit = QPushButton()
        self.submit.setObjectName("login_submit")
        style_class(self.submit, "primary")
        self.submit.clicked.connect(self._submit)
        self._build()
        self.refresh()

    def _build(self) -> None:
        card = QFrame()
        card.setFixedWidth(_CARD_WIDTH)
        style_class(card, "card")
        inside = QVBoxLayout(card)
        inside.setContentsMargins(32, 32, 32, 32)
        inside.setSpacing(16)
        logo = QLabel()
        logo.setPixmap(icon_pixmap("geoderm", 44, palette.ACCENT))
        inside.addWidget(logo)
        inside.addWidget(self.title)
        inside.addWidget(self.text)
        for field in (self.display_name, self.username, self.password, self.repeated):
            inside.addWidget(field)
            field.editor.returnPressed.connect(self._submit)  # type: ignore[attr-defined]
        inside.addWidget(self.problem)
        inside.addWidget(self.submit)
        note = QLabel("GeoDerm measures and relocates; it does not diagnose.")
        style_class(note, "caption")
        note.setAlignment(Qt.AlignmentFlag.AlignCenter)
        column = QVBoxLayout(self)
        column.addStretch(2)
        row = QHBoxLayout()
        row.addStretch(1)
        row.addWidget(card)
        row.addStretch(1)
        column.addLayout(row)
        column.addSpacing(16)
        column.addWidget(note)
        column.addStretch(3)

    @property
    def first_start(self) -> bool:
        """Whether there is no user yet."""
        return self._context.store.users.count() == 0

    def refresh(self) -> None:
        """Show the form that fits: first user, or sign in."""
        first = self.first_start
        self.title.setText("Welcome to GeoDerm" if first else "Sign in")
        self.text.setText(
            "Create your user. Your name is stored with every decision you make."
            if first
            else "Your name is stored with every decision you make."
        )
        self.submit.setText("Create user" if first else "Sign in")
        self.display_name.setVisible(first)
        self.repeated.setVisible(first)
        self.problem.hide()
        for field in (self.password, self.repeated):
            field.editor.clear()  # type: ignore[attr-defined]
        if not first and not self._text(self.username):
            self.username.editor.setText(self._context.settings.last_username)  # type: ignore[attr-defined]
        focus = self.display_name if first else self.password if self._text(self.username) else self.username
        focus.editor.setFocus()

    @staticmethod
    def _text(field: Field) -> str:
        return str(field.editor.text())  # type: ignore[attr-defined]

    @Slot()
    def _submit(self) -> None:
        self.problem.hide()
        try:
            user = self._create() if self.first_start else self._authenticate()
        except GeodermError as error:
            self._tell(str(error))
            return
        if user is not None:
            self._context.log_in(user)
            self.logged_in.emit()

    def _create(self) -> User | None:
        if self._text(self.password) != self._text(self.repeated):
            self.repeated.set_error("The two passwords differ.")
            return None
        return self._context.store.users.create(
            self._text(self.username), self._text(self.display_name), self._text(self.password)
        )

    def _authenticate(self) -> User | None:
        user = self._context.store.users.authenticate(self._text(self.username), self._text(self.password))
        if user is None:
            self._tell("User name or password is wrong.")
            self.password.editor.selectAll()  # type: ignore[attr-defined]
            self.password.editor.setFocus()
        return user

    def _tell(self, text: str) -> None:
        self.problem.setText(text)
        self.problem.show()
