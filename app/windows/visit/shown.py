"""The session's lesions as rows of a table, markers on a photo and markers on the body."""

from __future__ import annotations

from collections.abc import Sequence

from app.widgets.body_view import BodyLesion
from app.widgets.markers import Marker
from app.windows.visit.lesion_list import LesionLine
from app.workflows.session import VisitSession
from app.workflows.snapshot import has_place
from core.records import Lesion, Observation


def lesion_line(session: VisitSession, lesion: Lesion) -> LesionLine:
    """Row of a lesion."""
    site = "" if lesion.site is None else lesion.site.name
    images = sum(i.visit_id == session.visit_id for i in session.snapshot.dermoscopy.get(lesion.id, ()))
    if lesion.state == "removed":
        return LesionLine(
            str(lesion.id), lesion.number, site, "Removed by physician", "", "removed", False, images
        )
    status = session.status(lesion.id)
    return LesionLine(
        str(lesion.id),
        lesion.number,
        site,
        status.label,
        status.detail,
        status.tone,
        status.needs_doctor,
        images,
    )


def place_on(session: VisitSession, lesion: Lesion, capture_id: int | None) -> Observation | None:
    """The observation in force of a lesion if it has a place on this capture."""
    observation = session.snapshot.in_force(lesion.id)
    if observation is None or observation.capture_id != capture_id or not has_place(observation):
        return None
    return observation


def photo_markers(
    session: VisitSession, lesions: Sequence[Lesion], capture_id: int | None, *, movable: bool = True
) -> list[Marker]:
    """Markers of the lesions a capture shows; proposals with 95 % circle, corrections with a ghost."""
    markers = []
    for lesion in lesions:
        o = place_on(session, lesion, capture_id)
        if o is None or o.pixel is None:
            continue
        status = session.status(lesion.id)
        moved = o.decision == "corrected" and o.proposed_pixel is not None
        markers.append(
            Marker(
                str(lesion.id),
                str(lesion.number),
                o.pixel[0],
                o.pixel[1],
                status.tone,
                _radius_px(session, o) if o.decision == "proposed" else None,
                o.proposed_pixel if moved else None,
                f"Lesion {lesion.number}: {status.label}",
                movable,
            )
        )
    return markers


def body_lesions(
    session: VisitSession, lesions: Sequence[Lesion], capture_id: int | None
) -> list[BodyLesion]:
    """The same lesions on the 3D body."""
    shown = []
    for lesion in lesions:
        o = place_on(session, lesion, capture_id)
        if o is not None and o.point_m is not None:
            tone = session.status(lesion.id).tone
            shown.append(BodyLesion(str(lesion.id), str(lesion.number), o.point_m, tone))
    return shown


def earlier_markers(session: VisitSession, capture_id: int) -> list[Marker]:
    """Where the lesions were on a capture of an earlier visit."""
    found = ((x, session.snapshot.previous(x.id)) for x in session.snapshot.lesions)
    return [
        Marker(str(x.id), str(x.number), o.pixel[0], o.pixel[1], "confirmed", movable=False)
        for x, o in found
        if o is not None and o.capture_id == capture_id and o.pixel is not None
    ]


def _radius_px(session: VisitSession, o: Observation) -> float | None:
    if o.radius95_m is None or o.point_m is None or not session.is_ready(o.capture_id):
        return None
    camera = session.analysed(o.capture_id).capture.rig.picture_camera
    return o.radius95_m * camera.fx / max(o.point_m[2], 0.1)
