"""First page: which camera, and how its calibration stands."""

from __future__ import annotations

from collections.abc import Sequence

from PySide6.QtCore import Signal, Slot

from app.theme import palette
from app.widgets.status import EmptyState
from app.widgets.tables import Column, Row, RowTable
from app.windows.calibration.known_cameras import KnownCamera, state_in_words
from app.windows.calibration.last_checks import LastCheck
from app.windows.calibration.parts import Page, button, card, label


class ChoosePage(Page):
    """The list of cameras.

    Signals
    -------
    calibrate(object), check(object)
        A `KnownCamera`.
    look_again()
    """

    calibrate = Signal(object)
    check = Signal(object)
    look_again = Signal()

    def __init__(self) -> None:
        super().__init__("calibration_choose")
        self._cameras: dict[str, KnownCamera] = {}
        self.body.addWidget(
            label(
                "A calibration is needed once for each pair of cameras, and again when one of them "
                "was moved. The daily check takes ten seconds.",
                "secondary",
                wrap=True,
            )
        )
        frame, column = card(margin=4)
        self.table = RowTable(
            [
                Column("Camera"),
                Column("Serial number", 230),
                Column("Sensor", 150),
                Column("Calibration", 370),
            ]
        )
        self.table.setObjectName("calibration_cameras")
        self.table.setAccessibleName("Cameras")
        self.table.selected_changed.connect(self._refresh)
        self.table.activated_key.connect(lambda _key: self._go())
        self.empty = EmptyState(
            "camera", "Looking for cameras", "Connected cameras are asked for their serial numbers."
        )
        column.addWidget(self.table, 1)
        column.addWidget(self.empty, 1)
        self.body.addWidget(frame, 1)
        self.problem = label("", "field-error", "calibration_camera_problem", wrap=True)
        self.problem.hide()
        self.body.addWidget(self.problem)
        self.body.addWidget(
            label("Simulated patients are not listed: their geometry is known exactly.", "caption", wrap=True)
        )
        self.again = self.add_left(
            button("Look again", "secondary", "calibration_look_again", self.look_again.emit)
        )
        self.check_button = self.add_right(
            button("Daily check", "secondary", "calibration_check", self._check)
        )
        self.go = self.add_right(button("Calibrate", "primary", "calibration_start", self._go))
        self.set_looking()

    def set_looking(self) -> None:
        """The cameras are being asked."""
        self.table.hide()
        self.empty.set_text("Looking for cameras", "Connected cameras are asked for their serial numbers.")
        self.empty.show()
        self.again.setEnabled(False)
        self._refresh()

    def set_cameras(self, cameras: Sequence[KnownCamera], checks: dict[str, LastCheck]) -> None:
        """Show what was found."""
        self._cameras = {camera.info.id: camera for camera in cameras}
        rows = []
        for camera in cameras:
            last = None if camera.profile is None else checks.get(camera.profile.id)
            who = camera.identity
            serial = "" if who is None else who.depth_serial if who.lasting else "tells none"
            if who is not None and who.color_serial and who.color_serial != who.depth_serial:
                serial = f"{serial} + {who.color_serial}"
            moved = last is not None and last.verdict == "moved"
            color, symbol = palette.GREEN, "success"
            if camera.problem or moved:
                color, symbol = palette.RED if camera.problem else palette.AMBER, "warning"
            elif camera.profile is None:
                color, symbol = palette.SECONDARY, "info"
            rows.append(
                Row(
                    camera.info.id,
                    (
                        camera.info.name,
                        serial,
                        "" if who is None else who.sensor or "unknown",
                        state_in_words(camera, last),
                    ),
                    colors={3: color},
                    icons={3: (symbol, color)},
                    strong=frozenset({0}),
                    tooltip=camera.problem,
                )
            )
        self.table.set_rows(rows)
        if rows and self.table.selected() is None:
            self.table.set_selected(rows[0].key)
        self.table.setVisible(bool(rows))
        self.empty.set_text("No camera is connected", "Plug it in, wait a few seconds, then look again.")
        self.empty.setVisible(not rows)
        self.again.setEnabled(True)
        self._refresh()

    @property
    def chosen(self) -> KnownCamera | None:
        """The selected camera."""
        key = self.table.selected()
        return None if key is None else self._cameras.get(key)

    @Slot()
    def _refresh(self, _key: str = "") -> None:
        camera = self.chosen if self.table.isVisibleTo(self) else None
        usable = camera is not None and not camera.problem
        self.go.setEnabled(usable)
        self.check_button.setEnabled(usable and camera is not None and camera.profile is not None)
        self.check_button.setToolTip(
            "" if self.check_button.isEnabled() else "There is no calibration to check yet"
        )
        self.problem.setText(camera.problem if camera is not None else "")
        self.problem.setVisible(bool(self.problem.text()))

    def _go(self) -> None:
        if self.chosen is not None and self.go.isEnabled():
            self.calibrate.emit(self.chosen)

    def _check(self) -> None:
        if self.chosen is not None:
            self.check.emit(self.chosen)
