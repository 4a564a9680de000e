"""Carrying the first skin to the follow-up: dense registration, pinned by the constellation of moles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from core.anchors import AnalysedCapture
from core.lesions import SkinSpots
from core.relocation.bones import rigid_fit, torso_joints
from core.relocation.constellation import Matching, Side, match_spots, vote_locally
from core.relocation.moles import FirstMoles, gather_moles, usable
from core.relocation.pair import PickedLesion, VisitPair
from core.relocation.registration.deformation import Fit, Landmarks
from core.relocation.registration.dense import DenseRegistration, register_skins
from core.relocation.registration.start import SkeletonStart
from core.relocation.registry import MethodContext

FloatArray = NDArray[np.float64]

ROUNDS = 2
"""Matching and registering in turn; a third changed nothing on the tuning pairs."""
DRIFT_M = {False: 0.0045, True: 0.007}
"""What the registration leaves along the skin, in the same stance and in another (METHOD section 3).

Depth noisier than a Kinect v1's pulls it as much farther astray."""
OFF_M = 0.010
MOST_DOUBT = 4.0
"""A place that was carried off the seen skin drifted the more, up to so many times."""
PULL, CERTAIN_PULL = 3.0, 30.0
LEAST_LANDMARKS = 4
LIMB_MOVED_M = 0.06
LIMB_JOINTS = ("elbow", "hand", "knee", "foot")


@dataclass(frozen=True, eq=False)
class Transfer:
    """The first visit's moles on the follow-up's skin, m rows: lesions first.

    Attributes
    ----------
    moles : FirstMoles
    first_spots, spots : SkinSpots
        Of the first visit, and of the follow-up, k rows; none where looks may not be used.
    looks : ndarray (m, k)
    carried, normals : ndarray (m, 3)
        Where the registration carries places, before they are put on the seen skin, and their normals.
    matching : Matching
        `Matching.expected` is where each should be, on or near the seen skin.
    registration : DenseRegistration
    other_stance : bool
    pixel_m : float
        Size of a picture pixel on the follow-up's skin.
    """

    moles: FirstMoles
    first_spots: SkinSpots
    spots: SkinSpots
    looks: FloatArray
    carried: FloatArray
    normals: FloatArray
    matching: Matching
    registration: DenseRegistration
    other_stance: bool
    pixel_m: float

    @property
    def extent_m(self) -> float:
        """Radius of a disc as large as the skin of the follow-up on which spots may lie."""
        return self.registration.seen_radius_m

    @property
    def start(self) -> SkeletonStart:
        """The bones that the registration started from."""
        return self.registration.start

    @property
    def fit(self) -> Fit:
        """How well the skins lie on each other."""
        return self.registration.fit


def transfer_skin(
    pair: VisitPair, lesions: Sequence[PickedLesion], context: MethodContext
) -> Transfer | None:
    """Register, then match and register in turn; None without a trunk to start from."""
    context.progress(0.05, "Laying the first visit's skin onto the follow-up")
    with context.clock.phase("registration"):
        registration = register_skins(pair, seed=context.seed)
    if registration is None:
        return None
    other = stance_changed(pair)
    first_spots, spots = SkinSpots.none(), SkinSpots.none()
    if context.appearance:
        context.progress(0.4, "Finding the moles of both pictures")
        with context.clock.phase("spots"):
            first_spots, spots = usable(pair.first.spots), usable(pair.followup.spots)
    with context.clock.phase("matching"):
        drift = float(np.hypot(DRIFT_M[other], np.sqrt(pair.depth_excess_m2)))
        moles = gather_moles(lesions, context.known, first_spots, pair.first.scan.surface, registration.start)
        engine = _Matcher(pair, registration, moles, spots, moles.looks(first_spots, spots), drift)
        engine.hold(lesions, context)
        for turn in range(ROUNDS if len(spots) else 0):
            context.progress(0.5 + 0.2 * turn, "Matching the moles of both visits")
            engine.draw()
        carried, normals, matching = engine.match()
    return Transfer(
        moles,
        first_spots,
        spots,
        engine.looks,
        carried,
        normals,
        matching,
        registration,
        other,
        _pixel_m(pair.followup),
    )


def _pixel_m(capture: AnalysedCapture) -> float:
    """Size of a picture pixel on the skin."""
    distance = float(np.median(capture.scan.surface.vertices[:, 2]))
    return distance / capture.capture.rig.picture_camera.fx


class _Matcher:
    """State of the turns between matching and registering."""

    def __init__(
        self,
        pair: VisitPair,
        registration: DenseRegistration,
        moles: FirstMoles,
        spots: SkinSpots,
        looks: FloatArray,
        drift_m: float,
    ) -> None:
        self._surface = pair.followup.scan.surface
        self._registration, self._moles, self._spots, self.looks = registration, moles, spots, looks
        self._drift = drift_m
        self._certain: dict[int, FloatArray] = {}

    def hold(self, lesions: Sequence[PickedLesion], context: MethodContext) -> None:
        """Take the confirmed lesions as certain."""
        for number, place in enumerate(context.known):
            self._certain[len(lesions) + number] = place.followup.position_m
        if self._certain:
            self._solve({})

    def draw(self) -> None:
        """Match, and register again drawn by what matched."""
        side, *_ = self._side()
        pairs = vote_locally(side, self._spots.points_m, self._spots.normals, self.looks)
        voted = set(pairs.values())
        matching = match_spots(side, self._spots.points_m, self.looks, held=self._certain)
        for row in np.flatnonzero(matching.sure):
            if int(row) not in pairs and int(matching.partner[row]) not in voted:
                pairs[int(row)] = int(matching.partner[row])
        if len(pairs) + len(self._certain) >= LEAST_LANDMARKS:
            self._solve(pairs)

    def match(self) -> tuple[FloatArray, FloatArray, Matching]:
        """The last word: where places were carried, their normals, which spot each one is."""
        side, carried, normals = self._side()
        matching = match_spots(side, self._spots.points_m, self.looks, held=self._certain)
        if len(carried):
            on_skin = self._surface.nearest_arrays(matching.expected)[2]
            matching = Matching(matching.partner, matching.sure, on_skin, matching.sigma_m)
        return carried, normals, matching

    def _solve(self, pairs: dict[int, int]) -> None:
        rows = [*pairs, *(r for r in self._certain if r not in pairs)]
        targets = [self._certain.get(r, None) for r in rows]
        goals = [
            self._spots.points_m[pairs[r]] if t is None else t for r, t in zip(rows, targets, strict=True)
        ]
        pull = np.where([t is None for t in targets], PULL, CERTAIN_PULL)
        self._registration.draw(Landmarks(self._moles.places[rows], np.array(goals), pull))

    def _side(self) -> tuple[Side, FloatArray, FloatArray]:
        moles = self._moles
        if len(moles.places) == 0:
            nothing = np.zeros((0, 3))
            return Side(moles.coordinates, nothing, nothing, np.zeros(0)), nothing, nothing
        carried, normals = self._registration.deformation.warp(moles.places, moles.normals)
        on_skin = self._surface.nearest_arrays(carried)[2]
        off = np.linalg.norm(on_skin - carried, axis=1)
        drift = self._drift * np.clip(off / OFF_M, 1.0, MOST_DOUBT)
        return Side(moles.coordinates, on_skin, normals, drift), carried, normals


def stance_changed(pair: VisitPair) -> bool:
    """Whether arms or legs stand differently against the trunk than in the first visit."""
    trunk = torso_joints(pair)
    if trunk is None:
        return True
    rotation, shift = rigid_fit(*trunk)
    shared = set(pair.first.skeleton.visible()) & set(pair.followup.skeleton.visible())
    moved = [
        float(np.linalg.norm(rotation @ a + shift - b))
        for name in shared
        if name.endswith(LIMB_JOINTS)
        for a, b in [pair.joints_m(name)]
    ]
    if not moved:
        return False
    return float(np.median(moved)) > LIMB_MOVED_M or max(moved) > 2.0 * LIMB_MOVED_M
