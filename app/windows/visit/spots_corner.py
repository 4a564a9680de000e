"""Spots seen in one visit only, beside the lesions: listed, shown on the photo, marked by one click."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import QObject, Slot

from app.widgets.markers import Marker
from app.windows.visit.host import VisitHost
from app.windows.visit.lesion_screen import LesionScreen
from app.windows.visit.shown import spot_markers
from app.windows.visit.spots_panel import SpotLine
from app.workflows.evidence import SeenSpot
from app.workflows.table import State

_CLOSE = 5.0


class SpotsCorner(QObject):
    """Keeps the list of spots in step with the session.

    Parameters
    ----------
    host : VisitHost
    screen : LesionScreen
    show_capture : callable
        Brings up a capture of this visit.
    mark : callable
        Marks a new lesion at a pixel of a capture.
    """

    def __init__(
        self,
        host: VisitHost,
        screen: LesionScreen,
        show_capture: Callable[[int], None],
        mark: Callable[[int, tuple[float, float]], None],
    ) -> None:
        super().__init__(screen)
        self._host, self._screen, self._show_capture, self._mark = host, screen, show_capture, mark
        self._on = False
        screen.spots_toggled.connect(self._toggle)
        screen.spots.shown.connect(self._show)
        screen.spots.marked.connect(self._mark_spot)

    def refresh(self) -> None:
        """Show the session's spots; without any there is no button."""
        new, vanished = self._host.session.spots()
        count = len(new) + len(vanished)
        button = self._screen.spots_button
        button.setVisible(count > 0)
        button.setText(f" Spots only in one visit ({count})")
        if count == 0:
            self._on = False
        open_visit = self._host.session.state is State.CHECK
        self._screen.spots.set_spots(
            [self._line(s, markable=open_visit) for s in new],
            [self._line(s, markable=False) for s in vanished],
        )
        self._screen.show_spots(self._on)

    def markers(self, capture_id: int | None) -> list[Marker]:
        """What to draw on a capture while the list is open."""
        if not self._on:
            return []
        new, vanished = self._host.session.spots()
        return spot_markers((*new, *vanished), capture_id)

    def _line(self, spot: SeenSpot, *, markable: bool) -> SpotLine:
        record = self._host.session.snapshot.captures[spot.capture_id]
        return SpotLine(spot.key, f"{record.view.capitalize()} view, {spot.confidence:.0%} sure", markable)

    def _spot(self, key: str) -> tuple[SeenSpot | None, bool]:
        new, vanished = self._host.session.spots()
        found = next((s for s in (*new, *vanished) if s.key == key), None)
        return found, found in new

    @Slot(bool)
    def _toggle(self, on: bool) -> None:
        self._on = on
        self._host.session.changed.notify()

    @Slot(str)
    def _show(self, key: str) -> None:
        spot, is_new = self._spot(key)
        if spot is None:
            return
        if is_new:
            self._show_capture(spot.capture_id)
            self._screen.photo.center_on(*spot.pixel, _CLOSE)
        else:
            self._screen.set_pane("compare")
            self._screen.show_earlier_capture.emit(spot.capture_id)
            self._screen.previous.center_on(*spot.pixel, _CLOSE)

    @Slot(str)
    def _mark_spot(self, key: str) -> None:
        spot, is_new = self._spot(key)
        if spot is not None and is_new:
            self._show_capture(spot.capture_id)
            self._mark(spot.capture_id, spot.pixel)
