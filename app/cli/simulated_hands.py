"""Frames of simulated hands for the hand experiments: drawn once, kept in a folder if there is one."""

from __future__ import annotations

import io
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from core.capture.rgbd import CameraRig, RgbdCapture
from core.errors import InputError, WorkError
from core.evaluation.hand.frames import TrueFrame
from core.evaluation.records import code_fingerprint
from core.hand.documents import write_file
from core.hand.labels import FrameLabels
from core.hand.names import POINT_NAMES
from devices.simulator.hands.scene import HandFrame
from devices.simulator.hands.sequence import RATE_HZ, hand_sequence
from devices.simulator.hands.shots import HandVariation, Holder, shoot
from devices.simulator.room import SimulatedRig, make_rig

_PNG_SPEED = (cv2.IMWRITE_PNG_COMPRESSION, 1)


@dataclass(frozen=True)
class Stills:
    """Single frames of one hand, no two alike: the configurations in turn.

    Attributes
    ----------
    name : str
    holder : Holder
    configurations : tuple of str
    each : int
        Frames of every configuration.
    seed : int
        Of pose, view and noise: of configuration c, frame k it is ``seed + 1000 c + k``.
    variation : HandVariation
    cache : Path or None
    """

    name: str
    holder: Holder
    configurations: tuple[str, ...]
    each: int
    seed: int
    variation: HandVariation = field(default_factory=HandVariation)
    cache: Path | None = None

    @property
    def body(self) -> str:
        """The shape."""
        return self.holder.shape

    def __len__(self) -> int:
        return self.each * len(self.configurations)

    def __iter__(self) -> Iterator[TrueFrame]:
        rig = _rig(self.holder)
        for k in range(self.each):
            for c, configuration in enumerate(self.configurations):
                yield self._one(configuration, self.seed + 1000 * c + k, rig)

    def _one(self, configuration: str, seed: int, rig: SimulatedRig) -> TrueFrame:
        name = f"{self.body}_{configuration}_{seed}"
        path = None if self.cache is None else self.cache / self._folder() / f"{name}.npz"
        if path is not None and path.exists():
            return _read(path, name, self.body, rig)
        shot = shoot(self.holder, configuration, seed, variation=self.variation, rig=rig)
        return _kept(shot, path, name, self.body)

    def _folder(self) -> str:
        bare = "" if self.holder.marker_m > 0 else "-bare"
        return f"{self.name}{bare}-{_digest(self.holder, self.variation)}"


@dataclass(frozen=True)
class Motion:
    """A sequence of one hand.

    Attributes
    ----------
    kind : str
        One of `devices.simulator.hands.sequence.SEQUENCES`.
    holder : Holder
    frames : int
    seed : int
    configurations : tuple of str
        Empty for the kind's own.
    rate_hz : float
    cache : Path or None
    """

    kind: str
    holder: Holder
    frames: int
    seed: int
    configurations: tuple[str, ...] = ()
    rate_hz: float = RATE_HZ
    cache: Path | None = None

    @property
    def name(self) -> str:
        """The kind."""
        return self.kind

    @property
    def body(self) -> str:
        """The shape."""
        return self.holder.shape

    def __len__(self) -> int:
        return self.frames

    def __iter__(self) -> Iterator[TrueFrame]:
        rig = _rig(self.holder)
        names = [f"{self.kind}_{self.body}_{k:04d}" for k in range(self.frames)]
        if self.cache is None:
            drawn = self._drawn(rig)
            yield from (_kept(shot, None, n, self.body) for n, shot in zip(names, drawn, strict=True))
            return
        paths = [self.cache / self._folder() / f"{name}.npz" for name in names]
        shots: Iterator[HandFrame] | None = None
        for number, (name, path) in enumerate(zip(names, paths, strict=True)):
            if shots is None and path.exists():
                yield _read(path, name, self.body, rig)
                continue
            if shots is None:
                shots = self._drawn(rig)
                for _ in range(number):
                    next(shots)
            yield _kept(next(shots), path, name, self.body)

    def _drawn(self, rig: SimulatedRig) -> Iterator[HandFrame]:
        return hand_sequence(
            self.kind,
            self.holder,
            self.frames,
            seed=self.seed,
            configurations=self.configurations,
            rate_hz=self.rate_hz,
            rig=rig,
        )

    def _folder(self) -> str:
        bare = "" if self.holder.marker_m > 0 else "-bare"
        about = _digest(self.holder, self.frames, self.seed, self.configurations, self.rate_hz)
        return f"{self.kind}{bare}-{self.body}-{about}"


def cache_folder(cache: Path) -> Path:
    """Where the frames of this very simulator are kept.

    Raises
    ------
    InputError
        If the folder cannot be made.
    """
    folder = cache / f"hands-{simulator_code()}"
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot be made ({error.strerror or error}).") from error
    return folder


@lru_cache(maxsize=1)
def simulator_code() -> str:
    """Fingerprint of what draws the frames."""
    import devices.simulator

    root = Path(devices.simulator.__file__).parent
    hands = root / "hands"
    drawing = [hands / f"{name}.py" for name in ("model", "scene", "rendering", "shots", "things")]
    moving = [hands / f"{name}.py" for name in ("motions", "disturbed", "bottle_motion", "sequence")]
    return code_fingerprint([*drawing, *moving, root / "sensor.py"])


def _digest(*parts: Any) -> str:
    from hashlib import sha256

    return sha256(repr(parts).encode()).hexdigest()[:8]


@lru_cache(maxsize=64)
def _rig(holder: Holder) -> SimulatedRig:
    return make_rig((640, 480), device_seed=holder.seed)


def _kept(shot: HandFrame, path: Path | None, name: str, body: str) -> TrueFrame:
    frame = TrueFrame(name, body, shot.capture, shot.labels(), shot.remark)
    if path is not None:
        _write(path, frame)
    return frame


def _write(path: Path, frame: TrueFrame) -> None:
    about = {
        "configuration": frame.labels.configuration,
        "remark": frame.remark,
        "unit_m": frame.capture.depth_unit_m,
    }
    content = io.BytesIO()
    np.savez(
        content,
        depth=_encoded(frame.capture.depth_frames[0]),
        color=_encoded(frame.capture.color),
        points=frame.points_m,
        visible=frame.visible,
        about=np.frombuffer(json.dumps(about).encode(), np.uint8),
    )
    path.parent.mkdir(parents=True, exist_ok=True)
    write_file(path, content.getvalue())


def _read(path: Path, name: str, body: str, rig: SimulatedRig) -> TrueFrame:
    with np.load(path) as kept:
        about = json.loads(kept["about"].tobytes())
        depth, color = (cv2.imdecode(kept[key], cv2.IMREAD_UNCHANGED) for key in ("depth", "color"))
        points, visible = kept["points"], kept["visible"]
    if depth is None or color is None:
        raise WorkError(f"{path}: a kept frame cannot be read.", "Remove the file; it is drawn again.")
    cameras = CameraRig(rig.rig.depth, rig.rig.color, rig.rig.color_from_depth)
    capture = RgbdCapture(depth[None].astype(np.uint16), about["unit_m"], cameras, color, stance="hand")
    labels = FrameLabels(
        about["configuration"],
        dict(zip(POINT_NAMES, points, strict=True)),
        dict(zip(POINT_NAMES, map(bool, visible), strict=True)),
    )
    return TrueFrame(name, body, capture, labels, about["remark"])


def _encoded(image: NDArray[Any] | None) -> NDArray[np.uint8]:
    if image is None:
        raise WorkError("A simulated hand without a picture cannot be kept.")
    done, png = cv2.imencode(".png", image, _PNG_SPEED)
    if not done:
        raise WorkError("A simulated frame could not be encoded.")
    return np.asarray(png, dtype=np.uint8).ravel()


def count(sets: Sequence[Stills | Motion]) -> int:
    """Frames of all sets together."""
    return sum(len(one) for one in sets)
