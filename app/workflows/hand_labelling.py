"""Labelling the 15 points of one frame by clicks: which is next, skipping, correcting, taking back. No Qt."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from app.workflows.hand_rows import HandShot
from app.workflows.hand_skin import OFF_THE_HAND, FrameSkin
from app.workflows.notifier import Notifier
from core.hand.answer import HandAnswer
from core.hand.labels import FrameLabels
from core.hand.names import POINT_NAMES

FloatArray = NDArray[np.float64]

WAIT = "One moment: the skin of this frame is being measured."


@dataclass(frozen=True)
class _State:
    """What `undo` brings back."""

    places: dict[str, FloatArray] = field(default_factory=dict)
    hidden: frozenset[str] = frozenset()
    proposed: frozenset[str] = frozenset()
    current: str | None = POINT_NAMES[0]


class Labelling:
    """Points of one frame, as far as they are labelled.

    A point is *placed*, *hidden* (skipped, or stored as not visible), or open. A *proposed* one was placed by
    a model and has not been touched by a person.

    Attributes
    ----------
    changed : Notifier
    """

    def __init__(self) -> None:
        self.changed = Notifier()
        self._shot: HandShot | None = None
        self._skin: FrameSkin | None = None
        self._state = _State()
        self._before: list[_State] = []
        self._stored = _State()

    # --- the frame ---------------------------------------------------------------------------------------

    def begin(self, shot: HandShot | None, labels: FrameLabels | None = None) -> None:
        """Another frame, with what is stored of it; clicks wait for `set_skin`."""
        self._shot, self._skin, self._before = shot, None, []
        places = {} if labels is None else {n: np.asarray(p, float) for n, p in labels.points_m.items()}
        unseen = set() if labels is None else {n for n in places if not labels.visible.get(n, True)}
        if places:
            unseen |= set(POINT_NAMES) - set(places)
        current = None if places else POINT_NAMES[0]
        self._state = self._stored = _State(places, frozenset(unseen), frozenset(), current)
        self.changed.notify()

    def set_skin(self, skin: FrameSkin | None) -> None:
        """The frame's skin, once it is measured."""
        self._skin = skin
        self.changed.notify()

    @property
    def shot(self) -> HandShot | None:
        """The frame."""
        return self._shot

    @property
    def skin(self) -> FrameSkin | None:
        """Its skin, None until it is measured."""
        return self._skin

    # --- what there is -----------------------------------------------------------------------------------

    @property
    def current(self) -> str | None:
        """The point that the next click places; None when none is open."""
        return self._state.current

    @property
    def places_m(self) -> dict[str, FloatArray]:
        """Places of the points that are seen."""
        return {n: p for n, p in self._state.places.items() if n not in self._state.hidden}

    @property
    def hidden(self) -> frozenset[str]:
        """Points marked as not visible."""
        return self._state.hidden

    @property
    def proposed(self) -> frozenset[str]:
        """Points placed by a model."""
        return self._state.proposed

    @property
    def open(self) -> list[str]:
        """Points that are neither placed nor skipped."""
        s = self._state
        return [n for n in POINT_NAMES if n not in s.places and n not in s.hidden]

    @property
    def unsaved(self) -> bool:
        """Whether something was changed that is not stored."""
        return self._state is not self._stored and not (
            self._state.places == {} and self._stored.places == {} and not self._state.hidden
        )

    @property
    def can_undo(self) -> bool:
        """Whether there is something to take back."""
        return bool(self._before)

    def pixels(self) -> dict[str, tuple[float, float]]:
        """Where the seen points are in the picture."""
        places = self.places_m
        if self._shot is None or not places:
            return {}
        pixels = self._shot.rig.project_to_picture(np.array(list(places.values())))
        return {n: (float(u), float(v)) for n, (u, v) in zip(places, pixels, strict=True) if np.isfinite(u)}

    def labels(self, configuration: str) -> FrameLabels:
        """What is stored."""
        s = self._state
        return FrameLabels(configuration, dict(s.places), {n: n not in s.hidden for n in s.places})

    # --- what a person does ------------------------------------------------------------------------------

    def place(self, u: float, v: float) -> str:
        """Put the current point under a picture pixel; a sentence if that is not possible."""
        name = self._state.current
        if name is None:
            return (
                "All points are placed. Drag one to correct it, or choose one in the list to place it again."
            )
        refused = self._put(name, u, v)
        if not refused:
            self._go_on(name)
        return refused

    def move(self, name: str, u: float, v: float) -> str:
        """Put a point elsewhere; a sentence if that is not possible."""
        refused = self._put(name, u, v)
        self.changed.notify()
        return refused

    def skip(self) -> None:
        """The current point is hidden."""
        name = self._state.current
        if name is None:
            return
        s = self._state
        places = {n: p for n, p in s.places.items() if n != name}
        self._remember(_State(places, s.hidden | {name}, s.proposed - {name}, name))
        self._go_on(name)

    def select(self, name: str) -> None:
        """Make a point the one that the next click places."""
        s = self._state
        self._state = _State(s.places, s.hidden, s.proposed, name)
        if self._stored is s:
            self._stored = self._state
        self.changed.notify()

    def undo(self) -> None:
        """Take the last step back."""
        if self._before:
            self._state = self._before.pop()
            self.changed.notify()

    def clear(self) -> None:
        """Take every point away; it can be taken back."""
        self._remember(_State())
        self.changed.notify()

    def propose(self, answer: HandAnswer) -> int:
        """Take over what a model found for the points that are open; how many it knew."""
        s = self._state
        found = {
            n: answer.points_m[k]
            for k, n in enumerate(POINT_NAMES)
            if answer.found[k] and n not in s.places and n not in s.hidden
        }
        if found:
            places = s.places | found
            rest = [n for n in POINT_NAMES if n not in places and n not in s.hidden]
            current = rest[0] if rest else None
            self._remember(_State(places, s.hidden, s.proposed | frozenset(found), current))
            self.changed.notify()
        return len(found)

    def stored(self) -> None:
        """What there is now has been stored."""
        s = self._state
        self._state = self._stored = _State(s.places, s.hidden, frozenset(), s.current)
        self.changed.notify()

    # --- inside ------------------------------------------------------------------------------------------

    def _put(self, name: str, u: float, v: float) -> str:
        if self._shot is None:
            return "There is no frame to label."
        if self._skin is None:
            return WAIT
        if self._skin.surface is None:
            return f"This frame cannot be labelled: {self._skin.reason}"
        place = self._skin.pick(self._shot, u, v)
        if place is None:
            return OFF_THE_HAND
        s = self._state
        self._remember(_State(s.places | {name: place}, s.hidden - {name}, s.proposed - {name}, s.current))
        return ""

    def _remember(self, state: _State) -> None:
        self._before.append(self._state)
        self._state = state

    def _go_on(self, name: str) -> None:
        """The next open point after ``name``, in the order of the list."""
        s = self._state
        at = POINT_NAMES.index(name)
        order = POINT_NAMES[at + 1 :] + POINT_NAMES[:at]
        following = next((n for n in order if n not in s.places and n not in s.hidden), None)
        self._state = _State(s.places, s.hidden, s.proposed, following)
        self.changed.notify()
