"""Joints corrected by hand on a capture: judged anew before it is stored, stored anew afterwards."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from PySide6.QtCore import QObject, Signal, Slot

from app.windows.visit.host import VisitHost
from app.windows.visit.live_capture import correct_and_judge
from app.workflows.analysis import NewCapture

if TYPE_CHECKING:
    from app.windows.visit.capture_screen import CaptureScreen
    from core.anchors import AnalysedCapture, Skeleton


class JointCorrections(QObject):
    """Drives the joint editors of the capture screens.

    Parameters
    ----------
    host : VisitHost
    screens : sequence of CaptureScreen
    unsaved : callable
        The capture that waits to be stored, or None.

    Signals
    -------
    editing_changed()
        Correction was switched on or off, or what it led to has been computed.
    judged(object)
        A `Judged`: the capture that waits, with its new joints.
    """

    editing_changed = Signal()
    judged = Signal(object)

    def __init__(
        self,
        host: VisitHost,
        screens: Sequence[CaptureScreen],
        unsaved: Callable[[], NewCapture | None],
        parent: QObject,
    ) -> None:
        super().__init__(parent)
        self._host, self._screens, self._unsaved = host, screens, unsaved
        self._corrected: Skeleton | None = None
        self._stored: int | None = None
        for screen in screens:
            screen.joints.corrected.connect(self._on_corrected)
            screen.joints.editing_changed.connect(self._on_editing)

    @property
    def editing(self) -> bool:
        """Whether joints are being corrected."""
        return any(screen.joints.editing for screen in self._screens)

    def offer(self, screen: CaptureScreen, capture_id: int, analysed: AnalysedCapture) -> None:
        """Let the joints of a stored capture, which is shown, be corrected."""
        self._stored = capture_id
        screen.joints.set_capture(analysed)
        screen.joints.show()

    @Slot(object)
    def _on_corrected(self, skeleton: Skeleton) -> None:
        self._corrected = skeleton

    @Slot(bool)
    def _on_editing(self, on: bool) -> None:
        skeleton, self._corrected = self._corrected, None
        if on or skeleton is None:
            self.editing_changed.emit()
            return
        new, stored, session = self._unsaved(), self._stored, self._host.session
        if new is not None:
            waiting = new
            self._host.run(
                "Placing the anchors",
                lambda progress: correct_and_judge(waiting, skeleton, progress),
                self._on_judged,
                stopped=self.editing_changed.emit,
            )
        elif stored is not None:
            self._host.run(
                "Placing the anchors",
                lambda progress: session.correct_joints(stored, skeleton, progress),
                lambda _: self.editing_changed.emit(),
                stopped=self.editing_changed.emit,
            )

    def _on_judged(self, judged: object) -> None:
        self.editing_changed.emit()
        self.judged.emit(judged)
