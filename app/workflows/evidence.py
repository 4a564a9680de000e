"""What a search told beyond the records: regions, agreement, spots seen in one visit only.

It lives as long as the session. A visit that is opened again shows circles from the stored radius; a search
brings everything back.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from core.records import Observation

if TYPE_CHECKING:
    from core.relocation import RelocatedLesion

Pixel = tuple[float, float]

GEODESIC_REACH_M = 0.06
"""As in `core.relocation.site_check`: farther apart than this and the region, the two estimates disagree."""

SAME_PLACE_PX = 6.0
"""A spot this near a lesion's place in the picture is that lesion."""


@dataclass(frozen=True)
class SeenSpot:
    """A spot of one capture that the other visit does not show.

    Attributes
    ----------
    capture_id : int
        Of this visit for a new spot, of an earlier one for a spot that is gone.
    """

    capture_id: int
    pixel: Pixel
    confidence: float

    @property
    def key(self) -> str:
        """Name of its marker on a photo."""
        return f"spot:{self.capture_id}:{self.pixel[0]:.1f}:{self.pixel[1]:.1f}"

    def near(self, pixel: Pixel) -> bool:
        """Whether a place of the same capture is the spot's own."""
        return abs(self.pixel[0] - pixel[0]) < SAME_PLACE_PX and abs(self.pixel[1] - pixel[1]) < SAME_PLACE_PX


@dataclass(frozen=True, eq=False)
class Answer:
    """An answer of the engine for a lesion on a capture."""

    lesion_id: int
    capture_id: int
    relocated: RelocatedLesion


class VisitEvidence:
    """The answers of the searches of one session, by lesion and capture; the newest counts."""

    def __init__(self) -> None:
        self._answers: dict[tuple[int, int], RelocatedLesion] = {}
        self.new_spots: tuple[SeenSpot, ...] = ()
        self.vanished_spots: tuple[SeenSpot, ...] = ()

    def keep(self, answers: Iterable[Answer]) -> None:
        """Remember answers."""
        for answer in answers:
            self._answers[answer.lesion_id, answer.capture_id] = answer.relocated

    def keep_spots(self, new: tuple[SeenSpot, ...], vanished: tuple[SeenSpot, ...]) -> None:
        """Remember the spots of the newest search over all lesions."""
        self.new_spots, self.vanished_spots = new, vanished

    def answer(self, lesion_id: int, capture_id: int) -> RelocatedLesion | None:
        """The engine's answer for a lesion on a capture."""
        return self._answers.get((lesion_id, capture_id))

    def of(self, observation: Observation) -> RelocatedLesion | None:
        """The engine's answer behind the proposal that an observation holds."""
        answer = self.answer(observation.lesion_id, observation.capture_id)
        proposed = observation.proposed_point_m
        if answer is None or answer.point_m is None or proposed is None:
            return None
        same = all(abs(a - b) < 1e-6 for a, b in zip(answer.point_m, proposed, strict=True))
        return answer if same else None

    def axes_m(self, observation: Observation) -> tuple[float, float] | None:
        """Half axes of the proposal's region; the stored radius twice where the ellipse is not known."""
        answer = self.of(observation)
        if answer is not None and answer.region is not None:
            return answer.region.axes_m
        return None if observation.radius95_m is None else (observation.radius95_m, observation.radius95_m)

    def disagreement_m(self, observation: Observation) -> float | None:
        """How far apart geodesics and registration place the lesion, if that is beyond what they may."""
        answer = self.of(observation)
        axes = self.axes_m(observation)
        if answer is None or answer.agreement_m is None or axes is None:
            return None
        return answer.agreement_m if answer.agreement_m > GEODESIC_REACH_M + axes[0] else None
