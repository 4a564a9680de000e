"""The simulated patient as a depth camera: what the demonstration and the tests of the windows open."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from types import TracebackType
from typing import TYPE_CHECKING, Self
from urllib.parse import parse_qsl

import numpy as np

from core.capture.rgbd import RgbdCapture
from core.errors import InputError, WorkError
from core.progress import Progress, no_progress
from devices.camera import DEFAULT_FRAMES, DepthCamera, DeviceInfo, PreviewFrame
from devices.simulator.shapes import SHAPES, describe_shape

if TYPE_CHECKING:
    from devices.simulator.patient import SimulatedPatient
    from devices.simulator.truth import SimulatedCapture

_PREVIEW_WIDTH = 320


@dataclass(frozen=True)
class SimulatedScene:
    """How the simulated patient stands before the camera, see `SimulatedPatient.capture`."""

    stance: str = "psi"
    view: str = "front"
    visit: int = 1
    turn_deg: float = 0.0
    distance_m: float | None = None
    seed: int | None = None


class SimulatedCamera:
    """A virtual Kinect with a simulated patient in front of it.

    Parameters
    ----------
    patient : SimulatedPatient or str
        The patient, or the name of a body shape, who then gets its skin when the camera is opened.
    scene : SimulatedScene
    seed : int
        Of the patient, when only a shape is given.
    """

    def __init__(
        self,
        patient: SimulatedPatient | str = "m_young_avg",
        scene: SimulatedScene | None = None,
        seed: int = 0,
    ) -> None:
        self._shape = patient if isinstance(patient, str) else patient.shape
        if self._shape not in SHAPES:
            raise InputError(
                f"There is no simulated body called '{self._shape}'.", f"Choose one of: {', '.join(SHAPES)}."
            )
        self._patient = None if isinstance(patient, str) else patient
        self._seed = seed if isinstance(patient, str) else patient.seed
        self._scene = scene or SimulatedScene()
        self._preview: PreviewFrame | None = None
        self._ticks = np.random.default_rng(self._seed)
        self._last: SimulatedCapture | None = None
        self._opened = False

    @property
    def info(self) -> DeviceInfo:
        """Which camera this is."""
        suffix = f"?seed={self._seed}" if self._seed else ""
        return DeviceInfo(
            f"simulator:{self._shape}{suffix}",
            f"Simulated patient ({describe_shape(self._shape)})",
            "simulator",
            True,
        )

    @property
    def scene(self) -> SimulatedScene:
        """How the patient stands now."""
        return self._scene

    @scene.setter
    def scene(self, scene: SimulatedScene) -> None:
        if scene != self._scene:
            self._scene, self._preview = scene, None

    def stand(self, stance: str | None = None, view: str | None = None, visit: int | None = None) -> None:
        """Ask the patient to change stance, side or visit; None leaves it as it is."""
        now = self._scene
        self.scene = replace(
            now, stance=stance or now.stance, view=view or now.view, visit=visit or now.visit
        )

    @property
    def patient(self) -> SimulatedPatient:
        """The patient.

        Raises
        ------
        WorkError
            If the camera is closed.
        """
        if not self._opened or self._patient is None:
            raise WorkError("The simulated camera is closed.", "Open it first.")
        return self._patient

    @property
    def last(self) -> SimulatedCapture | None:
        """The last capture with its truth, for tests and evaluations."""
        return self._last

    def open(self) -> None:
        """Bring the patient in."""
        if self._patient is None:
            from devices.simulator.patient import SimulatedPatient

            self._patient = SimulatedPatient(self._shape, self._seed)
        self._opened = True

    def capture(self, frames: int = DEFAULT_FRAMES, progress: Progress = no_progress) -> RgbdCapture:
        """Depth frames and a colour picture of the patient as the `scene` says."""
        s = self._scene
        self._last = self.patient.capture(
            s.stance,
            s.view,
            s.visit,
            frames,
            s.seed,
            s.distance_m,
            s.turn_deg,
            taken_at=datetime.now(UTC),
            progress=progress,
        )
        return self._last.capture

    def preview(self) -> PreviewFrame | None:
        """Return a small frame; only the noise changes until the scene does."""
        if not self._opened:
            return None
        if self._preview is None:
            s = self._scene
            self._preview = self.patient.preview(s.stance, s.view, s.visit, s.seed, s.distance_m, s.turn_deg)
        still = self._preview
        if still.rgb is None or still.depth_m is None:
            return still
        rgb = still.rgb.astype(np.float32) + self._ticks.normal(0.0, 3.0, still.rgb.shape).astype(np.float32)
        grain = self._ticks.normal(0.0, 0.004, still.depth_m.shape).astype(np.float32)
        depth = np.where(still.depth_m > 0, still.depth_m + grain * still.depth_m, np.float32(0))
        return PreviewFrame(depth, np.clip(rgb, 0, 255).astype(np.uint8))

    def close(self) -> None:
        """Send the patient out; who it is stays."""
        self._opened = False

    def __enter__(self) -> Self:
        self.open()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()


class _SimulatedCameras:
    """Factory for ``simulator:SHAPE``, with options as in ``simulator:m_young_avg?seed=3&stance=A&visit=2``.

    Options: seed, and stance, view, visit, turn_deg, distance_m of the `SimulatedScene`.
    """

    def devices(self) -> Sequence[DeviceInfo]:
        """One camera per body shape."""
        return [SimulatedCamera(shape).info for shape in SHAPES]

    def create(self, address: str) -> DepthCamera:
        """Return the camera of a shape, not opened yet."""
        shape, _, options = address.partition("?")
        scene, seed = SimulatedScene(), 0
        for name, text in parse_qsl(options, keep_blank_values=True):
            try:
                if name == "seed":
                    seed = int(text)
                elif name == "stance":
                    scene = replace(scene, stance=text)
                elif name == "view":
                    scene = replace(scene, view=text)
                elif name == "visit":
                    scene = replace(scene, visit=int(text))
                elif name == "turn_deg":
                    scene = replace(scene, turn_deg=float(text))
                elif name == "distance_m":
                    scene = replace(scene, distance_m=float(text))
                else:
                    raise InputError(
                        f"A simulated camera has no option '{name}'.",
                        "It has seed, stance, view, visit, turn_deg and distance_m.",
                    )
            except ValueError as error:
                raise InputError(f"'{text}' is not a number for '{name}' of a simulated camera.") from error
        return SimulatedCamera(shape, scene, seed)


SIMULATED_CAMERAS = _SimulatedCameras()
