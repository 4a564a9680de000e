"""Cases for the evaluation from capture folders with clicked truth."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from app.cli.stored_pixels import mirrored_captures, query_as_read
from core.errors import InputError

if TYPE_CHECKING:
    from core.anchors import AnalysedCapture
    from core.capture import RgbdCapture
    from core.evaluation import CaseName, EvaluationCase, Joints, PendingCase, TrueLesion
    from core.evaluation.manifest import ManifestPair
    from core.relocation import LesionQuery


class CapturedCases:
    """The pairs of a manifest (`core.evaluation.CaseSource`)."""

    def __init__(self, pairs: Sequence[ManifestPair]) -> None:
        self._pairs = tuple(pairs)

    def __len__(self) -> int:
        return len(self._pairs)

    def cases(self) -> Iterator[PendingCase]:
        """All pairs, one at a time."""
        for pair in self._pairs:
            yield CapturedCase(pair)


class CapturedCase:
    """One pair of capture folders (`core.evaluation.PendingCase`)."""

    def __init__(self, pair: ManifestPair) -> None:
        self._pair = pair

    @cached_property
    def _captures(self) -> tuple[RgbdCapture, RgbdCapture]:
        from core.capture import read_capture

        return read_capture(self._pair.first), read_capture(self._pair.followup)

    @cached_property
    def name(self) -> CaseName:
        """Which pair; stances as the captures state them."""
        from core.evaluation import CaseName

        one, two = self._captures
        return CaseName(self._pair.case, self._pair.body, one.stance, two.stance)

    def load(self, joints: Joints, frames: int) -> EvaluationCase:
        """Analyse both captures.

        Raises
        ------
        InputError
            For joints that were not recorded, and truth that is not on the skin.
        """
        from core.evaluation import EvaluationCase

        start = time.perf_counter()
        first, followup = (
            _analysed(folder, capture, joints, frames)
            for folder, capture in zip((self._pair.first, self._pair.followup), self._captures, strict=True)
        )
        seconds = time.perf_counter() - start
        lesions = tuple(
            lesion
            for query in self._queries
            if (lesion := self._true_lesion(query, first, followup)) is not None
        )
        placed = [lesion for lesion in lesions if np.isfinite(lesion.followup_m).all() and not lesion.healed]
        return EvaluationCase(
            first=first,
            followup=followup,
            lesions=lesions,
            mole_ids=tuple(lesion.id for lesion in placed),
            moles_m=np.array([lesion.followup_m for lesion in placed]).reshape(-1, 3),
            first_joints_m=_joints_m(first),
            followup_joints_m=_joints_m(followup),
            analysis_seconds=seconds,
        )

    @cached_property
    def _queries(self) -> tuple[LesionQuery, ...]:
        """The lesions in pixels of the un-mirrored picture."""
        mirrored = mirrored_captures(self._pair.first, ["first"])
        out = []
        for i, query in enumerate(self._pair.lesions):
            if query.pixel is None:
                raise InputError(
                    f'{self._pair.lesions_file}: field "lesions[{i}].pixel" is missing; '
                    "an evaluation needs a pixel of the picture."
                )
            out.append(query_as_read(replace(query, capture=None), {"first": self._captures[0]}, mirrored))
        return tuple(out)

    def _true_lesion(
        self, query: LesionQuery, first: AnalysedCapture, followup: AnalysedCapture
    ) -> TrueLesion | None:
        """What is true of a lesion; None if the first click is not on the skin: it can be no lesion."""
        from core.evaluation import TrueLesion
        from core.relocation import LesionQuery, pick_query
        from core.surface import pick_skin

        here = pick_query(first, query).point
        if here is None or query.pixel is None:
            return None
        truth = self._pair.truth[query.id]
        pixel, place = (np.nan, np.nan), np.full(3, np.nan)
        if truth.pixel is not None:
            mirrored = mirrored_captures(self._pair.followup, ["followup"])
            clicked = LesionQuery(query.id, truth.pixel)
            pixel = query_as_read(clicked, {"followup": followup.capture}, mirrored).pixel or truth.pixel
            there = pick_skin(followup.scan, pixel)
            if there.point is None and truth.visible and truth.point_m is None:
                raise InputError(
                    f'{self._pair.truth_file}: lesion "{query.id}", field "pixel": {there.reason}',
                    'Click it again, or say "visible": false.',
                )
            place = place if there.point is None else np.asarray(there.point.position_m, float)
        if truth.point_m is not None:
            place = np.array(truth.point_m)
            projected = followup.capture.rig.project_to_picture(place)[0]
            pixel = (float(projected[0]), float(projected[1]))
        return TrueLesion(
            id=query.id,
            pixel=query.pixel,
            first_m=np.asarray(here.position_m, float),
            followup_m=place,
            followup_pixel=pixel,
            visible=truth.visible,
            healed=query.healed,
        )


def _analysed(folder: Path, capture: RgbdCapture, joints: Joints, frames: int) -> AnalysedCapture:
    from app.cli.simulated_cases import some_frames
    from core.anchors import analyse_capture
    from devices.trackers import default_tracker

    if joints == "true" and not capture.joints_m:
        raise InputError(f'{folder / "capture.json"}: field "joints_m" is missing; there are no true joints.')
    return analyse_capture(some_frames(capture, frames), default_tracker(), use_recorded=joints == "true")


def _joints_m(analysed: AnalysedCapture) -> dict[str, np.ndarray]:
    """Recorded joints, or without them the tracker's: for the names of body parts."""
    recorded = analysed.capture.joints_m
    if recorded:
        return dict(recorded)
    return {name: analysed.skeleton.point(name) for name in analysed.skeleton.visible()}
