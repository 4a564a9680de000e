"""A hand followed from frame to frame: anchors, surface, configuration, points."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from core.capture.rgbd import CameraRig
from core.capture.transform import RigidTransform
from core.errors import InputError, WorkError
from core.hand.anchors import MIRRORED_ORDER, AnchorFinder, FoundAnchors
from core.hand.answer import HandAnswer
from core.hand.fields import HandFields, measure_fields
from core.hand.fitting import MEASURED_SIGMA_M, HandFit, Hint, fit_configuration, size_share, sized
from core.hand.following import LastSeen, follow, motion_between
from core.hand.hand_model import HandModel
from core.hand.judging import Verdict, judge, misfit
from core.hand.model import OWN_FIELDS
from core.hand.names import PAIRS, POINT_NAMES
from core.hand.sequential import fit_sequentially
from core.hand.surface import HandSurface, cut_hand

FloatArray = NDArray[np.float64]

Refinement = Literal["joint", "sequential"]

FULL_CONFIDENCE_M = 0.008
"""A point whose distances disagree by this much has a confidence of 0.6."""

FOLLOWED_SIGMA_M = 0.005
"""Of distances from anchors that were not seen but followed: they are off by 2 to 7 mm."""

MOST_TOLD_MISFIT = 32.0
"""Up to it the points of the likeliest configuration are told, each by its own error, even if it is not told
itself; an open hand has 40 to 80 in a model of fist and outstretched index finger."""

OTHER_HAND = (
    "It looks like the other hand of the pair: the model was learned from a left or a right one only."
)

_CLEARLY = 0.6
_DOUBT = 4.0
_SIZE_TRUST = 0.5
_WORSE = 1.6
_USUAL = 0.8
_GLANCE = 3
"""Every so many frames one of the other configurations is looked at, in turn."""

_UNSURE_SHARE, _FOLLOWED_SHARE = 0.6, 0.8


@dataclass(frozen=True)
class TrackingOptions:
    """How a hand is followed.

    Attributes
    ----------
    refinement : {"joint", "sequential"}
        All points solved together, or the thesis's eq. 7, point after point.
    threshold_m : float
        A point whose distances disagree with the model by more is not reported.
    lost_frames : int
        For how many frames the marker may be lost.
    configuration : str or None
        Known beforehand; otherwise it is judged.
    """

    refinement: Refinement = "joint"
    threshold_m: float = 0.012
    lost_frames: int = 10
    configuration: str | None = None


@dataclass(eq=False)
class _Past:
    """What is remembered of the frames before."""

    configuration: str | None = None
    b: dict[str, FloatArray] = field(default_factory=dict)
    points_m: FloatArray | None = None
    anchors_m: FloatArray | None = None
    last: LastSeen | None = None
    motion: RigidTransform = field(default_factory=RigidTransform)
    step: RigidTransform = field(default_factory=RigidTransform)
    lost: int = 0
    usual_misfit: float = 0.0
    frames: int = 0
    size: float | None = None
    own_hand: bool = False

    def guesses(self) -> list[RigidTransform]:
        """Motions since the hand was last seen: going on, staying, and turning back as when shaken."""
        on = RigidTransform(
            self.step.rotation @ self.motion.rotation, self.step.apply(self.motion.translation)
        )
        back = RigidTransform(self.motion.rotation, 2 * self.motion.translation - on.translation)
        return [on, self.motion, back]


class HandTracker:
    """Follows one hand. `track` is called with frames in their order; not thread safe.

    Parameters
    ----------
    model : HandModel
    rig : CameraRig
    finder : AnchorFinder
        Of the kind that the model was learned with (`core.hand.finders.finder_for`).
    options : TrackingOptions, optional

    Raises
    ------
    InputError
        If the options name a configuration that was not learned.
    """

    def __init__(
        self, model: HandModel, rig: CameraRig, finder: AnchorFinder, options: TrackingOptions | None = None
    ) -> None:
        self._model, self._rig, self._finder = model, rig, finder
        self._options = options or TrackingOptions()
        known = self._options.configuration
        if known is not None and known not in model.configurations:
            raise InputError(
                f"The model has no configuration '{known}'.",
                f"It has learned: {', '.join(model.configurations)}.",
            )
        self._past = _Past()
        self._times: dict[str, float] = {}

    def reset(self) -> None:
        """Forget the frames before: the next one is the first."""
        self._past = _Past()

    def track(self, depth_m: FloatArray, rgb: NDArray[np.uint8] | None) -> HandAnswer:
        """Find the points in the next frame.

        Parameters
        ----------
        depth_m : ndarray (h, w)
            Metres, 0 for no measurement.
        rgb : ndarray (h', w', 3) uint8 or None
        """
        self._times = {}
        with self._timed("anchors"):
            anchors, followed = self._anchors(depth_m, rgb)
        if not np.isfinite(anchors.places_m).all(axis=1).any():
            return self._nothing(anchors.reason or "The hand was not found.", anchors)
        try:
            with self._timed("surface"):
                toward = self._model.toward_fingers @ anchors.places_m
                known = bool(np.isfinite(toward).all())
                hand = cut_hand(depth_m, self._rig.depth, anchors.places_m, toward=toward if known else None)
        except WorkError as error:
            return self._nothing(str(error), anchors)
        if hand.touching is not None:
            return replace(self._nothing(hand.touching, anchors), surface=hand)
        with self._timed("distances"):
            fields = measure_fields(hand, anchors.places_m, threads=1)
        if self._other_hand(fields):
            return replace(self._nothing(OTHER_HAND, anchors), surface=hand)
        verdict, fit = self._fit(fields, motion_between(self._before(anchors), anchors.places_m))
        with self._timed("answer"):
            return self._answer(anchors, followed, hand, fields, verdict, fit)

    def _before(self, anchors: FoundAnchors) -> FloatArray:
        before = self._past.anchors_m
        return np.full(anchors.places_m.shape, np.nan) if before is None else before

    @contextmanager
    def _timed(self, step: str) -> Iterator[None]:
        begun = time.perf_counter()
        yield
        self._times[step] = self._times.get(step, 0.0) + time.perf_counter() - begun

    def _anchors(self, depth_m: FloatArray, rgb: NDArray[np.uint8] | None) -> tuple[FoundAnchors, bool]:
        """Anchors by the finder, or by the surface of the last frame that had them; and which."""
        past = self._past
        near = past.anchors_m if past.lost == 0 else None
        found = self._finder.find(rgb, depth_m, self._rig, near)
        if found.seen:
            past.lost = 0
            return found, False
        past.lost += 1
        if past.last is None or past.lost > self._options.lost_frames:
            if past.last is not None:
                said = (
                    f"{found.reason or 'The marker is lost.'} It has been lost for too long to be followed."
                )
                self.reset()
                return FoundAnchors(found.places_m, False, said), False
            return found, False
        motion = follow(past.last, depth_m, self._rig.depth, past.guesses())
        if motion is None:
            return FoundAnchors(found.places_m, False, found.reason), False
        said = f"{found.reason or 'The marker is lost.'} Followed by the shape of the hand."
        places = motion.apply(past.last.anchors_m)
        past.motion = motion
        return FoundAnchors(places, False, said), True

    def _fit(self, fields: HandFields, moved: RigidTransform) -> tuple[Verdict, HandFit]:
        """Points and configuration; all configurations are tried where there is a doubt."""
        past, options = self._past, self._options
        models = self._model.configurations
        fits: dict[str, HandFit] = {}
        current = options.configuration or past.configuration
        if current is not None:
            with self._timed("points"):
                fits[current] = self._fit_one(current, fields, moved)
            worse = misfit(models[current], fits[current])
            if options.configuration is None:
                with self._timed("configuration"):
                    doubtful = worse > _WORSE * past.usual_misfit + _DOUBT or self._rivalled(
                        current, worse, fits[current], fields
                    )
                if not doubtful:
                    past.usual_misfit += (1.0 - _USUAL) * (worse - past.usual_misfit)
                    return Verdict(current, current, {current: 1.0}, {current: worse}), fits[current]
        if options.configuration is None:
            with self._timed("configuration"):
                for name in models:
                    if name not in fits:
                        fits[name] = self._look(name, fields, self._same_size(name))
        verdict = judge(models, self._model.tree, fits)
        if current is not None or past.size is not None:
            # what the frames before said may be wrong: the likeliest is looked for without it as well
            with self._timed("configuration"):
                afresh = self._look(verdict.best, fields, None)
            if misfit(models[verdict.best], afresh) < verdict.misfit[verdict.best]:
                fits[verdict.best] = afresh
                verdict = judge(models, self._model.tree, fits)
        known = verdict.configuration is not None
        past.size = size_share(models[verdict.best], fits[verdict.best].b) if known else None
        if verdict.configuration is not None and verdict.configuration != past.configuration:
            past.usual_misfit = verdict.misfit[verdict.configuration]
        past.configuration = verdict.configuration
        return verdict, fits[verdict.best]

    def _rivalled(self, current: str, worse: float, fit: HandFit, fields: HandFields) -> bool:
        """Whether another configuration, one of them every few frames, fits better than the current one."""
        past, models = self._past, self._model.configurations
        others = [name for name in models if name != current]
        past.frames += 1
        if not others or past.frames % _GLANCE or self._options.refinement != "joint":
            return False
        name = others[past.frames // _GLANCE % len(others)]
        past.size = size_share(models[current], fit.b)
        return misfit(models[name], self._look(name, fields, self._same_size(name))) < worse

    def _other_hand(self, fields: HandFields) -> bool:
        """Whether it is the other hand of the pair: asked until one of the two has fitted clearly better."""
        past, models = self._past, self._model.configurations
        order = MIRRORED_ORDER[self._model.anchors]
        if past.own_hand or len(order) + OWN_FIELDS != len(fields.values_m):
            return False
        mirrored = fields.values_m[[*order, *range(len(order), len(fields.values_m))]]
        vertices, solver = fields.surface.vertices, fields.solver
        with self._timed("configuration"):
            own, other = (
                min(
                    misfit(model, fit_configuration(model, vertices, values, solver))
                    for model in models.values()
                )
                for values in (fields.values_m, mirrored)
            )
        past.own_hand = own < _CLEARLY * other
        return other < _CLEARLY * own

    def _same_size(self, name: str) -> Hint | None:
        """Where to begin with another configuration of a hand whose size is known."""
        if self._past.size is None:
            return None
        nowhere = np.full((len(POINT_NAMES), 3), np.nan)
        return Hint(sized(self._model.configurations[name], self._past.size), nowhere, trust=_SIZE_TRUST)

    def _fit_one(self, name: str, fields: HandFields, moved: RigidTransform) -> HandFit:
        past = self._past
        hint = None
        if name == past.configuration and name in past.b and past.points_m is not None:
            hint = Hint(past.b[name], moved.apply(past.points_m))
        return self._look(name, fields, hint)

    def _look(self, name: str, fields: HandFields, hint: Hint | None) -> HandFit:
        fit = fit_configuration if self._options.refinement == "joint" else fit_sequentially
        return fit(
            self._model.configurations[name],
            fields.surface.vertices,
            fields.values_m,
            fields.solver,
            hint,
            FOLLOWED_SIGMA_M if self._past.lost else MEASURED_SIGMA_M,
        )

    def _answer(
        self,
        anchors: FoundAnchors,
        followed: bool,
        hand: HandSurface,
        fields: HandFields,
        verdict: Verdict,
        fit: HandFit,
    ) -> HandAnswer:
        error = np.fmax(fit.anchor_error_m, fit.pair_error_m)
        told = np.isfinite(fit.points_m).all(axis=1) & (error <= self._options.threshold_m)
        # a hand that is far from every learned configuration has its points elsewhere
        told &= verdict.misfit[verdict.best] <= MOST_TOLD_MISFIT
        points = np.where(told[:, None], fit.points_m, np.nan)
        confidence = np.where(told, np.exp(-0.5 * (np.nan_to_num(error) / FULL_CONFIDENCE_M) ** 2), 0.0)
        if verdict.configuration is None:
            confidence = confidence * _UNSURE_SHARE
        if followed:
            confidence = confidence * _FOLLOWED_SHARE
        past = self._past
        past.b[verdict.best] = fit.b
        past.points_m = np.where(np.isfinite(points), points, np.nan)
        past.step = motion_between(self._before(anchors), anchors.places_m)
        past.anchors_m = anchors.places_m
        if not followed:
            past.lost, past.motion = 0, RigidTransform()
            toward = self._model.toward_fingers @ anchors.places_m
            known = bool(np.isfinite(toward).all())
            past.last = LastSeen.of(hand.surface, anchors.places_m, toward if known else None)
        i, j = np.array(PAIRS).T
        both = told[i] & told[j]
        return HandAnswer(
            configuration=verdict.configuration,
            points_m=points,
            pixels=self._rig.project_to_picture(points),
            confidence=confidence,
            error_m=error,
            anchors_m=fields.anchors_m,
            marker_seen=anchors.seen,
            reason=self._reason(anchors, verdict, bool(told.any())),
            pair_m=np.where(both, fit.pair_m, np.nan),
            expected_pair_m=np.where(both, fit.expected_pair_m, np.nan),
            likelihood=dict(verdict.likelihood),
            surface=hand,
            times_s=dict(self._times),
        )

    def _nothing(self, reason: str, anchors: FoundAnchors) -> HandAnswer:
        """No point can be told."""
        return HandAnswer(
            anchors_m=anchors.places_m, marker_seen=anchors.seen, reason=reason, times_s=dict(self._times)
        )

    def _reason(self, anchors: FoundAnchors, verdict: Verdict, told: bool) -> str | None:
        said = [anchors.reason] if anchors.reason is not None else []
        if verdict.configuration is None:
            said.append(
                "The hand is in none of the configurations that were learned, or between two."
                if self._options.configuration is None
                else "The hand is not in the configuration that was given."
            )
        elif not told:
            limit_mm = 1000 * self._options.threshold_m
            said.append(f"No point agrees with the model to within {limit_mm:.0f} mm.")
        return " ".join(said) or None
