"""The simulated patient as a live depth camera: what training, the demonstration and the tests open."""

from __future__ import annotations

import threading
from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any
from uuid import uuid4

import cv2
import numpy as np

from core.calibration.profile import CalibrationProfile
from core.capture.rgbd import CameraRig, RgbdCapture
from core.errors import InputError, WorkError
from core.progress import Progress, no_progress
from devices.camera import DEFAULT_FRAMES, DeviceInfo, OpenedByWith, PreviewFrame
from devices.live import (
    DEFAULT_STREAMS,
    CameraControl,
    CameraIdentity,
    LiveFrame,
    LiveState,
    StreamKind,
    StreamMode,
)
from devices.simulator.live_faults import NO_FAULTS, Faults
from devices.simulator.live_light import LONGEST_S, SHORTEST_S, LightControl
from devices.simulator.live_sway import SWAYS, Sway
from devices.simulator.shapes import SHAPES, describe_shape

if TYPE_CHECKING:
    from devices.simulator.live_scene import LiveScene
    from devices.simulator.live_stream import PatientStream
    from devices.simulator.patient import SimulatedPatient
    from devices.simulator.room import SimulatedRig
    from devices.simulator.truth import SimulatedCapture

_FPS = 30


@dataclass(frozen=True)
class SimulatedScene:
    """How the simulated patient stands before the camera, see `SimulatedPatient.capture`."""

    stance: str = "psi"
    view: str = "front"
    visit: int = 1
    turn_deg: float = 0.0
    distance_m: float | None = None
    seed: int | None = None


class SimulatedCamera(OpenedByWith):
    """A virtual depth camera with a simulated patient in front of it: a `devices.live.LiveCamera`.

    The viewfinder's picture is that of the colour camera reduced to 640 pixels, and `rig` is the geometry of
    what `latest` shows; captures have the full picture and bring their own rig. The drawing is done by
    another process from the first look on, so that neither the viewfinder nor a capture holds up a window;
    a camera that only takes captures draws in its own process. Both draw the same.

    Parameters
    ----------
    patient : SimulatedPatient or str
        The patient, or the name of a body shape, who then gets its skin when the camera is opened.
    scene : SimulatedScene
    seed : int
        Of the patient, when only a shape is given.
    sway : {"still", "calm", "restless"}
        How the patient stands.
    light : float
        Of the room, 1 for a well-lit one.
    faults : Faults
        What goes wrong, counted from the first frame after each opening.
    """

    def __init__(
        self,
        patient: SimulatedPatient | str = "m_young_avg",
        scene: SimulatedScene | None = None,
        seed: int = 0,
        *,
        sway: Sway = "calm",
        light: float = 1.0,
        faults: Faults = NO_FAULTS,
    ) -> None:
        self._shape = patient if isinstance(patient, str) else patient.shape
        if self._shape not in SHAPES:
            raise InputError(
                f"There is no simulated body called '{self._shape}'.", f"Choose one of: {', '.join(SHAPES)}."
            )
        if sway not in SWAYS:
            raise InputError(f"A simulated patient cannot stand '{sway}'.", f"Choose {', '.join(SWAYS)}.")
        if not light > 0:
            raise InputError("The light of a simulated room must be above 0.")
        self._own = None if isinstance(patient, str) else patient
        self._patient = self._own
        self._seed = seed if isinstance(patient, str) else patient.seed
        self._token = f"{self._shape}-{self._seed}" if isinstance(patient, str) else uuid4().hex
        self._scene = scene or SimulatedScene()
        self._sway, self._faults = sway, faults
        self._light = LightControl(light)
        self._simulated_rig: SimulatedRig | None = None
        self._live_rig: CameraRig | None = None
        self._profile: CalibrationProfile | None = None
        self._stream: PatientStream | None = None
        self._stream_turn = threading.Lock()
        self._last: SimulatedCapture | None = None
        self._opened = False

    # --- who and how ------------------------------------------------------------------------------------

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
    def identity(self) -> CameraIdentity:
        """Serial numbers made of shape and seed; the colour camera is a separate one."""
        serial = f"SIM-{self._shape}-{self._seed}"
        sensor = getattr(self._virtual_rig.sensor, "name", "kinect-v1")
        return CameraIdentity("Simulated depth camera", serial, f"{serial}-AUX", str(sensor))

    @property
    def scene(self) -> SimulatedScene:
        """How the patient stands, or is about to."""
        return self._scene

    @scene.setter
    def scene(self, scene: SimulatedScene) -> None:
        if scene != self._scene:
            self._scene = scene
            if self._stream is not None:
                self._stream.stand(scene)

    def stand(self, stance: str | None = None, view: str | None = None, visit: int | None = None) -> None:
        """Ask the patient to change stance, side or visit; None leaves it as it is.

        The viewfinder follows within a second or two, in which the patient is seen to move.
        """
        now = self._scene
        self.scene = replace(
            now, stance=stance or now.stance, view=view or now.view, visit=visit or now.visit
        )

    def step(self, distance_m: float | None = None, turn_deg: float | None = None) -> None:
        """Ask the patient to come nearer, step back or turn; None leaves it as it is."""
        now = self._scene
        self.scene = replace(
            now,
            distance_m=now.distance_m if distance_m is None else distance_m,
            turn_deg=now.turn_deg if turn_deg is None else turn_deg,
        )

    @property
    def changing(self) -> bool:
        """Whether the viewfinder still shows an earlier stance than `scene`."""
        return self._stream is not None and self._stream.changing

    @property
    def patient(self) -> SimulatedPatient:
        """The patient.

        Raises
        ------
        WorkError
            If the camera is closed.
        """
        self._check_open()
        if self._patient is None:
            from devices.simulator.patient import SimulatedPatient

            self._patient = SimulatedPatient(self._shape, self._seed)
        return self._patient

    @property
    def last(self) -> SimulatedCapture | None:
        """The last capture with its truth, for tests and evaluations."""
        return self._last

    @property
    def _virtual_rig(self) -> SimulatedRig:
        if self._simulated_rig is None:
            from devices.simulator.room import make_rig

            self._simulated_rig = make_rig() if self._own is None else self._own.rig
        return self._simulated_rig

    @property
    def rig(self) -> CameraRig:
        """Geometry of the frames of `latest`: the profile's, or the true one."""
        if self._live_rig is None:
            from devices.simulator.live_geometry import live_rig_of

            self._live_rig = live_rig_of(
                self._virtual_rig.rig if self._profile is None else self._profile.rig
            )
        return self._live_rig

    @property
    def profile(self) -> CalibrationProfile | None:
        """The calibration in use; None for the true geometry."""
        return self._profile

    def use_profile(self, profile: CalibrationProfile | None) -> None:
        """Use a calibration, made of the viewfinder's pictures or of the captures'."""
        if profile is not None:
            from devices.simulator.live_calibration import check_profile

            check_profile(profile, self.identity, self._virtual_rig.rig)
        self._profile, self._live_rig = profile, None

    # --- the present ------------------------------------------------------------------------------------

    def open(self) -> None:
        """Bring the patient in. Nothing is drawn before somebody looks or takes a capture."""
        self._opened = True

    def close(self) -> None:
        """Send the patient out; who it is stays."""
        self._opened = False
        with self._stream_turn:
            stream, self._stream = self._stream, None
        if stream is not None:
            stream.close()

    @property
    def state(self) -> LiveState:
        """How the camera is now."""
        if not self._opened:
            return LiveState.CLOSED
        stream = self._stream
        return LiveState.STREAMING if stream is None else stream.state

    def start(self, streams: Collection[StreamKind] = DEFAULT_STREAMS) -> None:
        """Stream these kinds from now on, counted from frame 1."""
        if "infrared" in streams:
            raise WorkError("The simulated patient is not filmed in infrared.", "Choose depth and colour.")
        if not streams:
            raise WorkError("A camera needs at least one stream.")
        self._look(streams).restart(streams)

    def _check_open(self) -> None:
        if not self._opened:
            raise WorkError("The simulated camera is closed.", "Open it first.")

    def _look(self, streams: Collection[StreamKind] = DEFAULT_STREAMS) -> PatientStream:
        self._check_open()
        with self._stream_turn:
            if self._stream is None:
                from devices.simulator.live_stream import PatientStream
                from devices.simulator.live_sway import StandingPerson
                from devices.simulator.room import Variation

                natural = Variation() if self._own is None else self._own.variation
                share = SWAYS[self._sway]
                sway_m, breath_m = share * natural.sway_m, min(share, 1.0) * natural.breath_m
                self._stream = PatientStream(
                    self._draw,
                    self._scene,
                    lambda stature_m: StandingPerson(sway_m, breath_m, stature_m, self._seed),
                    self._seed,
                    streams,
                    self._faults,
                )
                self._stream.light(self._light)
            return self._stream

    def latest(self, after: int = 0, timeout_s: float = 0.0) -> LiveFrame | None:
        """The newest frame if its number is greater than ``after``, see `devices.live.LiveCamera`.

        The first one is there two to five seconds after the first look: the patient has to be drawn.
        """
        return self._look().latest(after, timeout_s)

    def preview(self) -> PreviewFrame | None:
        """Return the newest frame made small, None while the camera is closed or has none yet."""
        if not self._opened:
            return None
        from devices.simulator.live_geometry import made_small

        frame = self.latest()
        return None if frame is None else made_small(frame)

    def modes(self) -> tuple[StreamMode, ...]:
        """One mode for each stream."""
        depth, color = self.rig.depth, self.rig.picture_camera
        return (
            StreamMode("depth", depth.width, depth.height, _FPS, "depth_1_mm"),
            StreamMode("color", color.width, color.height, _FPS, "rgb888"),
        )

    def choose_mode(self, mode: StreamMode) -> None:
        """Accept the mode that is in force."""
        if mode not in self.modes():
            raise InputError("The simulated camera has no such mode.", "Choose one of those it offers.")

    def controls(self) -> tuple[CameraControl, ...]:
        """Exposure of the colour camera."""
        light = self._light
        return (
            CameraControl("auto_exposure", float(light.automatic)),
            CameraControl("exposure_s", light.exposure_in_force_s, SHORTEST_S, LONGEST_S),
        )

    def set_control(self, name: str, value: float) -> None:
        """Set a control; an exposure chosen by hand ends the automatic one."""
        control = next((c for c in self.controls() if c.name == name), None)
        if control is None:
            raise InputError(f"The simulated camera has no control '{name}'.")
        if not control.minimum <= value <= control.maximum:
            raise InputError(f"{name} goes from {control.minimum:g} to {control.maximum:g}.")
        if name == "auto_exposure":
            now = self._light.exposure_in_force_s
            self._light = replace(self._light, automatic=bool(value), exposure_s=now)
        else:
            self._light = replace(self._light, automatic=False, exposure_s=value)
        if self._stream is not None:
            self._stream.light(self._light)

    # --- captures ---------------------------------------------------------------------------------------

    def capture(self, frames: int = DEFAULT_FRAMES, progress: Progress = no_progress) -> RgbdCapture:
        """Depth frames and a colour picture in full size of the patient as the `scene` says."""
        self._check_open()
        stream = self._stream

        def report(fraction: float, message: str = "") -> None:
            if stream is not None:
                stream.check()
                if stream.state is LiveState.STALLED:
                    raise WorkError(
                        "The simulated camera has stopped delivering frames.",
                        "Unplug and reconnect it, then try again.",
                    )
            progress(fraction, message)

        report(0.0)
        scene, sway, now = self._scene, SWAYS[self._sway], datetime.now(UTC)
        if stream is None:
            from devices.simulator.live_scene import take_capture

            taken = take_capture(self.patient, scene, sway, frames, now, report)
        else:
            taken = self._ask("capture", progress=report, scene=scene, sway=sway, frames=frames, taken_at=now)
        self._last = replace(taken, capture=self._finished(taken.capture))
        return self._last.capture

    def _finished(self, capture: RgbdCapture) -> RgbdCapture:
        """The capture as this camera's exposure and calibration make it."""
        color, table = capture.color, self._light.table
        if table is not None and color is not None:
            color = np.asarray(cv2.LUT(color, table), np.uint8)
        capture = replace(capture, sensor=capture.sensor or self.identity.sensor, color=color)
        if self._profile is None:
            return capture
        from devices.simulator.live_calibration import calibrated

        return calibrated(capture, self._profile)

    def _draw(self, scene: SimulatedScene, stop: Callable[[], bool]) -> LiveScene:
        drawn: LiveScene = self._ask("pose", scene=scene, stop=stop)
        return drawn

    def _ask(
        self,
        operation: str,
        *,
        progress: Progress = no_progress,
        stop: Callable[[], bool] = lambda: False,
        **arguments: object,
    ) -> Any:
        """Let the drawing process do something with this patient, who is sent there if he is not yet."""
        from devices.simulator.live_parcel import pack_patient
        from devices.simulator.live_process import DRAWING

        if not DRAWING.request("has", token=self._token, stop=stop):
            parcel = None if self._own is None else pack_patient(self._own)
            DRAWING.request(
                "admit", token=self._token, shape=self._shape, seed=self._seed, parcel=parcel, stop=stop
            )
        return DRAWING.request(operation, token=self._token, progress=progress, stop=stop, **arguments)
