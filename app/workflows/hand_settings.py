"""How hands are looked at: the anchors, the marker, and how a tracker decides. No Qt."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from core.errors import InputError
from core.hand.anchors import AnchorFinder, AnchorKind
from core.hand.hand_model import DEFAULT_MARKER_M, HandModel
from core.hand.marker import DEFAULT_DICTIONARY, dictionaries
from core.hand.model_file import MARKER_RANGE_M
from core.hand.tracker import Refinement, TrackingOptions

if TYPE_CHECKING:
    from core.hand.landmarks import HandDetector

SMALLEST_MARKER_M, LARGEST_MARKER_M = MARKER_RANGE_M
LARGEST_THRESHOLD_M = 0.100
MOST_LOST_FRAMES = 300


@dataclass(frozen=True)
class HandSettings:
    """What the options sheet holds.

    Attributes
    ----------
    refinement : {"joint", "sequential"}
    threshold_m : float
        A point whose distances disagree with the model by more is not told.
    lost_frames : int
        For how many frames the marker may be lost.
    anchors : {"marker", "palm"}
        What new models are learned with; a model keeps its own.
    marker_m : float
        Side of the marker's black square, for new models.
    dictionary : str
        Of ArUco, for new models.
    """

    refinement: Refinement = "joint"
    threshold_m: float = TrackingOptions.threshold_m
    lost_frames: int = TrackingOptions.lost_frames
    anchors: AnchorKind = "marker"
    marker_m: float = DEFAULT_MARKER_M
    dictionary: str = DEFAULT_DICTIONARY

    @property
    def tracking(self) -> TrackingOptions:
        """The part that a tracker takes."""
        return TrackingOptions(
            refinement=self.refinement, threshold_m=self.threshold_m, lost_frames=self.lost_frames
        )


def read_millimetres(text: str, what: str, smallest_m: float, largest_m: float) -> float:
    """Metres from what a person typed as millimetres.

    Raises
    ------
    InputError
        With a sentence that says what to type.
    """
    plain = text.strip().removesuffix("mm").strip().replace(",", ".")
    try:
        value_m = float(plain) / 1000.0
    except ValueError:
        raise InputError(f"{what} is not a number.", "Type a number of millimetres.") from None
    if not smallest_m <= value_m <= largest_m:
        raise InputError(
            f"{what} must be between {1000 * smallest_m:.0f} and {1000 * largest_m:.0f} mm.",
            "Measure it with a ruler." if "marker" in what.lower() else "12 mm suits most hands.",
        )
    return value_m


def read_count(text: str, what: str, largest: int) -> int:
    """A whole number from what a person typed.

    Raises
    ------
    InputError
        With a sentence that says what to type.
    """
    try:
        value = int(text.strip())
    except ValueError:
        raise InputError(f"{what} is not a whole number.", "Type a number such as 10.") from None
    if not 0 <= value <= largest:
        raise InputError(f"{what} must be between 0 and {largest}.")
    return value


def check_dictionary(name: str) -> str:
    """The name of an ArUco dictionary.

    Raises
    ------
    InputError
        If there is none of that name.
    """
    if name not in dictionaries():
        raise InputError(
            f"There is no ArUco dictionary '{name}'.", "Use one such as DICT_4X4_50 or DICT_5X5_100."
        )
    return name


def empty_model(settings: HandSettings) -> HandModel:
    """A model that knows no configuration yet: enough to find its anchors."""
    return HandModel({}, None, settings.anchors, settings.marker_m, settings.dictionary)


def finder_of(model: HandModel, detector: HandDetector | None = None) -> AnchorFinder:
    """What finds a model's anchors; the palm's detector is started here if it is needed and not given.

    Raises
    ------
    InputError
        If there are no such anchors.
    WorkError
        If the detector cannot be started.
    """
    from core.hand.finders import finder_for

    return finder_for(model, detector)
