"""What the hand window is given; no patients' records among it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from app.context import AppContext, CameraSource
    from app.tasks import TaskRunner
    from devices.camera import DepthCamera


@dataclass(frozen=True)
class HandDesk:
    """See the module's documentation.

    Attributes
    ----------
    tasks : TaskRunner
    cameras : CameraSource
        Which cameras there are.
    open_camera : callable
        The opened camera of an id, with its calibration; any thread.
    """

    tasks: TaskRunner
    cameras: CameraSource
    open_camera: Callable[[str], DepthCamera]

    @staticmethod
    def of(context: AppContext) -> HandDesk:
        """The desk of the clinic's application."""
        return HandDesk(context.tasks, context.cameras, context.open_camera)
