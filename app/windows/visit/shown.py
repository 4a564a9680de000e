"""The session's lesions as rows of a table, markers on a photo and markers on the body."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from app.widgets.body_view import BodyLesion
from app.widgets.markers import Marker
from app.windows.visit.lesion_list import LesionLine
from app.workflows.evidence import SeenSpot
from app.workflows.session import VisitSession
from app.workflows.snapshot import has_place
from core.records import Lesion, Observation

CANDIDATE = "candidate:"
"""Markers of a lesion's other places are named ``candidate:LESION:INDEX``."""

_BORDER_POINTS = 72
_MOST_CANDIDATES = 4


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
    """Markers of the lesions a capture shows; proposals with 95 % region, corrections with a ghost."""
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
                region_outline(session, o) if o.decision == "proposed" else (),
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


def region_outline(session: VisitSession, o: Observation) -> tuple[tuple[float, float], ...]:
    """Border of a proposal's 95 % region in picture pixels: the ellipse on the skin, seen by the camera."""
    axes = session.evidence.axes_m(o)
    if axes is None or o.point_m is None or not session.is_ready(o.capture_id):
        return ()
    analysed = session.analysed(o.capture_id)
    center = np.asarray(o.point_m)
    surface = analysed.scan.surface
    normal = surface.normal_at(surface.nearest(center)[0])
    answer = session.evidence.of(o)
    long = (
        np.asarray(answer.region.direction)
        if answer is not None and answer.region is not None
        else np.eye(3)[int(np.argmin(np.abs(normal)))]
    )
    long = long - (long @ normal) * normal
    size = float(np.linalg.norm(long))
    if size < 1e-6:
        return ()
    long = long / size
    angles = np.linspace(0.0, 2.0 * np.pi, _BORDER_POINTS, endpoint=False)[:, None]
    border = center + axes[0] * np.cos(angles) * long + axes[1] * np.sin(angles) * np.cross(normal, long)
    return tuple((float(u), float(v)) for u, v in analysed.capture.rig.project_to_picture(border))


def candidate_markers(session: VisitSession, lesion: Lesion, capture_id: int | None) -> list[Marker]:
    """The other places that fit a lesion which the doctor has not decided on, to be chosen by a click."""
    o = place_on(session, lesion, capture_id)
    if o is None or o.decision != "proposed":
        return []
    return [
        Marker(
            f"{CANDIDATE}{lesion.id}:{i}",
            f"{lesion.number}{chr(ord('b') + i)}",
            c.pixel[0],
            c.pixel[1],
            "uncertain",
            tooltip=f"Another place that fits lesion {lesion.number}. Click to put the lesion here.",
            movable=False,
        )
        for i, c in enumerate(o.candidates[:_MOST_CANDIDATES])
        if c.pixel is not None
    ]


def spot_markers(spots: Sequence[SeenSpot], capture_id: int | None) -> list[Marker]:
    """Spots of one visit only, on the capture that shows them."""
    return [
        Marker(s.key, "?", s.pixel[0], s.pixel[1], "removed", tooltip="Seen in one visit only", movable=False)
        for s in spots
        if s.capture_id == capture_id
    ]
