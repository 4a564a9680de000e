"""The photo of an earlier visit beside the present one."""

from __future__ import annotations

from app.windows.visit.host import VisitHost
from app.windows.visit.lesion_screen import LesionScreen
from app.windows.visit.pictures import stored_picture
from app.windows.visit.shown import earlier_markers
from app.windows.visit.spots_corner import SpotsCorner
from app.workflows.wording import when


class EarlierPhoto:
    """Chooses and shows a capture of an earlier visit while the screen compares.

    Parameters
    ----------
    host : VisitHost
    screen : LesionScreen
    spots : SpotsCorner
        Gives the spots that are drawn with the lesions.
    """

    def __init__(self, host: VisitHost, screen: LesionScreen, spots: SpotsCorner) -> None:
        self._host, self._screen, self._spots = host, screen, spots
        self._shown: int | None = None

    def show(self, selected: int | None) -> None:
        """The photo on which the selected lesion was last seen, else the newest one."""
        if self._screen.pane != "compare":
            return
        snapshot = self._host.session.snapshot
        places = {x.id: snapshot.previous(x.id) for x in snapshot.lesions}
        chosen = places.get(selected) if selected is not None else None
        chosen = chosen or next((o for o in reversed(list(places.values())) if o is not None), None)
        if chosen is None:
            self._screen.show_previous([], "There is no previous visit to compare with.")
            return
        self.show_capture(chosen.capture_id, selected)

    def show_capture(self, capture_id: int, selected: int | None) -> None:
        """One capture of an earlier visit."""
        session, snapshot = self._host.session, self._host.session.snapshot
        record = snapshot.captures[capture_id]
        if self._shown != record.id:
            self._shown = record.id
            self._screen.previous.set_image(stored_picture(session.store, record))
        visit = next(v for v in (*snapshot.earlier, snapshot.visit) if v.id == record.visit_id)
        self._screen.show_previous(
            [*earlier_markers(session, record.id), *self._spots.markers(record.id)],
            f"Visit {visit.number}, {record.view} view, {when(record.taken_at)}",
        )
        self._screen.previous.set_selected(None if selected is None else str(selected))
