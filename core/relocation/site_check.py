"""Whether a clicked site is the stored lesion's: the check before a surgeon cuts.

It errs on the side of "cannot tell": an answer "inside" is given only on evidence that carries it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from core.anchors import AnalysedCapture
from core.errors import InputError
from core.relocation.field_store import FIELDS
from core.relocation.pair import VisitPair, anchor_points
from core.relocation.relocate import pick_query
from core.relocation.types import LesionQuery, Region, RelocatedLesion
from core.surface import BodySurface, SkinPick, SurfacePoint, pick_skin, pick_skin_depth

FloatArray = NDArray[np.float64]
SiteVerdict = Literal["inside", "outside", "cannot tell"]

LARGEST_M = 0.04
"""A region longer than this (half axis) does not single out a site.

A circle of 40 mm is 50 cm2 of skin, a palm. With the 60 to 480 moles of the people that are followed up,
spread over 1.7 m2, such a patch holds 0.2 to 1.4 other moles on average: being inside no longer means being
at the lesion."""

CLEARLY_OUTSIDE = 2.0
"""Of a region too large to say "inside", a site this many half axes away is still outside."""

LEAST_CONFIDENCE = 0.3
"""Below, the place itself is in doubt."""

GEODESIC_REACH_M = 0.06
"""Trilateration and registration agree within this and the region's half axis, or one of them is lost.

Trilateration from tracked joints errs by 20 to 30 mm in the mean and by some 60 mm in one of twenty cases."""

SIGNATURE_REACH_M = 0.05
"""Median difference of the distances to the anchors between lesion and site, beyond which the site's position
on the body contradicts the lesion's. Joints repeat to 10 to 40 mm."""

LEAST_ANCHORS = 4
CLICK_PX = 0.5
"""A click is no finer than half a pixel: so wide is the border."""


@dataclass(frozen=True, eq=False)
class SiteCheck:
    """What can be said about a clicked site.

    Attributes
    ----------
    verdict : {"inside", "outside", "cannot tell"}
    reason : str
        One or more sentences.
    distance_m : float or None
        From the region's centre to the site, along the skin; None where there is no region or no skin.
    border_m : float or None
        From the region's border to the site: positive outside, negative inside.
    normalised : float or None
        Distance from the centre in units of the ellipse: 1 on its border.
    axes_m : (a, b) or None
        Half axes of the region.
    point_m : ndarray (3,) or None
        The clicked skin, depth-camera frame.
    also_inside : tuple of str
        Other lesions whose region holds the site, too.
    signature_m : float or None
        Median difference of the distances along the skin to the anchors, lesion in the first capture against
        site; None where it was not computed.
    """

    verdict: SiteVerdict
    reason: str
    distance_m: float | None = None
    border_m: float | None = None
    normalised: float | None = None
    axes_m: tuple[float, float] | None = None
    point_m: FloatArray | None = None
    also_inside: tuple[str, ...] = ()
    signature_m: float | None = None


def check_site(
    lesion: RelocatedLesion,
    followup: AnalysedCapture,
    pixel: tuple[float, float],
    *,
    others: Sequence[RelocatedLesion] = (),
    first: AnalysedCapture | None = None,
    query: LesionQuery | None = None,
) -> SiteCheck:
    """Check whether a clicked site lies inside the 95 % region of a relocated lesion.

    Parameters
    ----------
    lesion : RelocatedLesion
        The answer in ``followup``.
    pixel : (u, v)
        The click, in the follow-up's picture (the depth image for a recording without colour).
    others : sequence of RelocatedLesion
        Answers for other stored lesions: a site inside two regions belongs to the nearer one at best.
    first, query : optional
        The stored lesion; with them the site's distances to the anchors are compared with the lesion's.

    Returns
    -------
    SiteCheck

    Raises
    ------
    InputError
        If the pixel is outside the picture.
    """
    pick = _pick(followup, pixel)
    if pick.point is None:
        return SiteCheck("cannot tell", pick.reason or "The click is not on the skin.", axes_m=_axes(lesion))
    place = pick.point.position_m
    if lesion.point_m is None:
        told = {
            "not_visible": "The lesion's place is not in view",
            "refused": "The lesion was not found",
        }.get(lesion.status, "The lesion has no place")
        return SiteCheck("cannot tell", f"{told}: {lesion.reason}", point_m=place)
    field = FIELDS.solver(followup.scan.surface, "virtual-source").distances([pick.point])
    offset = site_offset(followup.scan.surface, lesion.point_m, pick.point, field)
    region = region_of(lesion, followup.scan.surface)
    connected = bool(np.isfinite(_corner_values(followup.scan.surface, lesion.point_m, field)).all())
    also = tuple(
        other.id
        for other in others
        if other.id != lesion.id and _holds(other, followup.scan.surface, pick.point, field)
    )
    normalised, border = ellipse_position(offset, region, followup.scan.surface, lesion.point_m)
    signature = None if first is None or query is None else _signature_m(first, query, followup, pick.point)
    distance = float(np.linalg.norm(offset))
    margin = _click_margin_m(followup, pick.point)
    verdict, reason = _judge(lesion, region, normalised, border, margin, signature)
    if verdict == "inside" and not connected:
        verdict, reason = "cannot tell", "The skin between the site and the lesion was not measured."
    if also and verdict == "inside":
        nearer = _nearest_of(others, also, followup.scan.surface, pick.point, field, normalised)
        if nearer:
            verdict, reason = (
                "cannot tell",
                f"The site lies nearer to lesion {nearer} than to lesion {lesion.id}.",
            )
    if also:
        reason = f"{reason} It is also inside the region of {', '.join(also)}."
    for warning in pick.warnings:
        reason = f"{reason} {warning}"
    return SiteCheck(verdict, reason, distance, border, normalised, region.axes_m, place, also, signature)


def _pick(followup: AnalysedCapture, pixel: tuple[float, float]) -> SkinPick:
    rig = followup.capture.rig
    camera = rig.picture_camera
    if not np.isfinite(pixel).all() or not camera.contains(pixel)[0]:
        raise InputError(
            f"The site [{pixel[0]:g}, {pixel[1]:g}] is outside the follow-up's image "
            f"({camera.width} x {camera.height})."
        )
    head = followup.skeleton.joints.get("head")
    pick = pick_skin if rig.has_color else pick_skin_depth
    return pick(followup.scan, pixel, head_m=None if head is None else head.point_m)


def _axes(lesion: RelocatedLesion) -> tuple[float, float] | None:
    if lesion.region is not None:
        return lesion.region.axes_m
    return None if lesion.radius95_m is None else (lesion.radius95_m, lesion.radius95_m)


def region_of(lesion: RelocatedLesion, surface: BodySurface) -> Region:
    """The lesion's region; a circle of its stated radius where it has no ellipse.

    Raises
    ------
    InputError
        If the lesion states neither.
    """
    if lesion.region is not None:
        return lesion.region
    if lesion.radius95_m is None or lesion.point_m is None:
        raise InputError(f'Lesion "{lesion.id}" states no region.')
    normal = surface.normal_at(surface.nearest(lesion.point_m)[0])
    return Region((lesion.radius95_m, lesion.radius95_m), _across(normal))


def _across(normal: FloatArray) -> FloatArray:
    """Any unit vector (3,) perpendicular to a normal."""
    side = np.cross(normal, np.eye(3)[int(np.argmin(np.abs(normal)))])
    return np.asarray(side / np.linalg.norm(side))


def site_offset(
    surface: BodySurface, centre_m: FloatArray, site: SurfacePoint, field: FloatArray
) -> FloatArray:
    """Vector (3,) in the tangent plane at a centre: toward the site, as long as the way along the skin.

    The way is the geodesic distance, never less than the straight one. On skin that the camera does not show
    as connected it is the straight one, which the true way cannot undercut.

    Parameters
    ----------
    field : ndarray (1, n)
        Distances of every vertex from the site.
    """
    centre = surface.nearest(centre_m)[0]
    normal = surface.normal_at(centre)
    straight = site.position_m - centre_m
    length = float(np.linalg.norm(straight))
    corners = _corner_values(surface, centre_m, field)
    if np.isfinite(corners).all():
        along = np.sqrt(max(float(centre.barycentric @ corners**2) - _spread(surface, centre), 0.0))
        length = max(length, float(along))
    flat = straight - (straight @ normal) * normal
    size = float(np.linalg.norm(flat))
    direction = flat / size if size > 1e-9 else _across(normal)
    return np.asarray(direction * length)


def _corner_values(surface: BodySurface, place_m: FloatArray, field: FloatArray) -> FloatArray:
    """Values (3,) of a field at the corners of the triangle nearest to a place."""
    return np.asarray(field[0][surface.triangles[surface.nearest(place_m)[0].triangle]])


def _spread(surface: BodySurface, point: SurfacePoint) -> float:
    """How much the mean of squared corner distances exceeds the squared distance inside the triangle."""
    corners, w = surface.vertices[surface.triangles[point.triangle]], point.barycentric
    pairs = ((0, 1), (1, 2), (2, 0))
    return float(sum(w[i] * w[j] * np.sum((corners[i] - corners[j]) ** 2) for i, j in pairs))


def ellipse_position(
    offset: FloatArray, region: Region, surface: BodySurface, centre_m: FloatArray
) -> tuple[float, float]:
    """Where a tangent offset lies: in units of the ellipse (1: its border), and metres beyond the border."""
    normal = surface.normal_at(surface.nearest(centre_m)[0])
    along = region.direction - (region.direction @ normal) * normal
    along = along / np.linalg.norm(along) if np.linalg.norm(along) > 1e-6 else _across(normal)
    x, y = float(offset @ along), float(offset @ np.cross(normal, along))
    a, b = region.axes_m
    normalised = float(np.hypot(x / a, y / b))
    angles = np.linspace(0.0, 2.0 * np.pi, 721)
    nearest = float(np.hypot(a * np.cos(angles) - x, b * np.sin(angles) - y).min())
    return normalised, nearest if normalised > 1.0 else -nearest


def _holds(other: RelocatedLesion, surface: BodySurface, site: SurfacePoint, field: FloatArray) -> bool:
    return _normalised(other, surface, site, field) <= 1.0


def _normalised(
    lesion: RelocatedLesion, surface: BodySurface, site: SurfacePoint, field: FloatArray
) -> float:
    if lesion.point_m is None or _axes(lesion) is None:
        return float("inf")
    offset = site_offset(surface, lesion.point_m, site, field)
    return ellipse_position(offset, region_of(lesion, surface), surface, lesion.point_m)[0]


def _nearest_of(
    others: Sequence[RelocatedLesion],
    also: tuple[str, ...],
    surface: BodySurface,
    site: SurfacePoint,
    field: FloatArray,
    own: float,
) -> str:
    """The other lesion to which the site is nearer than to the asked one, in units of each region."""
    rivals = [o for o in others if o.id in also and o.status in ("found", "predicted")]
    ranked = sorted((_normalised(o, surface, site, field), o.id) for o in rivals)
    return ranked[0][1] if ranked and ranked[0][0] < own else ""


def _click_margin_m(followup: AnalysedCapture, site: SurfacePoint) -> float:
    """Half a pixel on the skin, longer where the skin is seen at an angle."""
    surface, camera = followup.scan.surface, followup.capture.rig.picture_camera
    view = site.position_m / np.linalg.norm(site.position_m)
    facing = max(abs(float(surface.normal_at(site) @ view)), 0.2)
    return CLICK_PX * float(site.position_m[2]) / camera.fx / facing


def _signature_m(
    first: AnalysedCapture, query: LesionQuery, followup: AnalysedCapture, site: SurfacePoint
) -> float | None:
    """Median difference of the distances along the skin to the shared anchors; None with too few."""
    pair = VisitPair(first, followup)
    names = pair.joint_names
    pick = pick_query(first, query)
    if pick.point is None or len(names) < LEAST_ANCHORS:
        return None
    fields = [
        FIELDS.fields(analysed.scan.surface, anchor_points(analysed, names), "virtual-source")
        for analysed in (first, followup)
    ]
    there, here = fields[0].at([pick.point])[:, 0], fields[1].at([site])[:, 0]
    both = np.isfinite(there) & np.isfinite(here)
    return float(np.median(np.abs(there - here)[both])) if both.sum() >= LEAST_ANCHORS else None


def _judge(
    lesion: RelocatedLesion,
    region: Region,
    normalised: float,
    border_m: float,
    margin_m: float,
    signature_m: float | None,
) -> tuple[SiteVerdict, str]:
    """The verdict and one sentence."""
    if lesion.status not in ("found", "predicted"):
        return "cannot tell", f"The place is not unique: {lesion.reason}"
    size = f"{region.axes_m[0] * 1000:.0f} mm"
    if region.axes_m[0] > LARGEST_M and normalised < CLEARLY_OUTSIDE:
        return "cannot tell", (
            f"The lesion's place is known only to {size} (95 %); beyond {LARGEST_M * 1000:.0f} mm one site "
            "cannot be told from its neighbours."
        )
    if lesion.confidence < LEAST_CONFIDENCE:
        return "cannot tell", f"The place is in doubt (confidence {lesion.confidence:.0%})."
    if lesion.agreement_m is not None and lesion.agreement_m > GEODESIC_REACH_M + region.axes_m[0]:
        return "cannot tell", (
            f"Distances along the skin place the lesion {lesion.agreement_m * 1000:.0f} mm from where its "
            "surroundings do."
        )
    if abs(border_m) < margin_m:
        return "cannot tell", "The site lies on the border of the region, as finely as can be clicked."
    if normalised > 1.0:
        return "outside", f"The site is outside the region in which the lesion lies with 95 % ({size})."
    if signature_m is not None and signature_m > SIGNATURE_REACH_M:
        return "cannot tell", (
            f"The site's distances to the joints differ from the lesion's by {signature_m * 1000:.0f} mm "
            "(median)."
        )
    how = "seen again in the picture" if lesion.appearance_matched else "computed, not seen again"
    return "inside", f"The site is inside the region in which the lesion lies with 95 % ({how})."
