"""A still camera that drops its files into a folder, as tethered DSLR cameras do."""

from __future__ import annotations

import hashlib
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from urllib.parse import parse_qsl

from core.errors import InputError, WorkError
from devices.auxiliary.camera import ColorCameraInfo, ColorIdentity, TimedPicture
from devices.auxiliary.camera_clock import CameraClock
from devices.auxiliary.picture_file import SUFFIXES, PictureFile, Unusable, read_picture
from devices.auxiliary.uvc import latency_of
from devices.live import CameraControl, LiveState, StreamMode

POLL_S = 0.1
_SETTLED_S = 0.3
_GIVE_UP_S = 5.0
_GONE_AFTER_S = 1.0
_ARRIVAL_SIGMA_S = 0.7
_KEPT = 3
_ZOOMED = 0.01
_MOST_FILES = 20_000
_TURNED = "The picture file asks to be shown turned; it is used as the sensor took it."


@dataclass(frozen=True)
class RejectedFile:
    """A new file that is no usable picture."""

    name: str
    reason: str


@dataclass
class _Arriving:
    size: int
    changed_ns: int
    first_s: float
    same_since_s: float
    reason: str = ""


class FolderWatchCamera:
    """The pictures that appear in a folder from now on; those that are there already are not looked at.

    A file is taken when its size has not changed for a moment and it can be decoded to its end; until then it
    is waited for. A file that is written over counts as a new picture.

    Parameters
    ----------
    folder : Path
    latency_s : float
        From the exposure to the moment the file begins to appear; measure it for the camera in use.
    """

    def __init__(self, folder: Path, latency_s: float = 0.0) -> None:
        self._folder, self._clock = folder, CameraClock(latency_s, _ARRIVAL_SIGMA_S)
        name = hashlib.sha256(str(folder.resolve()).encode()).hexdigest()[:8]
        self._identity = ColorIdentity(folder.name, f"folder-{name}", False)
        self._news = threading.Condition()
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None
        self._reset()

    def _reset(self) -> None:
        self._seen: dict[str, tuple[int, int]] = {}
        self._arriving: dict[str, _Arriving] = {}
        self._rejected: list[RejectedFile] = []
        self._pictures: list[TimedPicture] = []
        self._count = 0
        self._first: PictureFile | None = None
        self._missing_since: float | None = None
        self._gone: str = ""

    @property
    def info(self) -> ColorCameraInfo:
        """Which folder this is."""
        return ColorCameraInfo(
            f"folder-watch:{self._folder}", f"Still camera ({self._folder.name})", "folder-watch"
        )

    @property
    def identity(self) -> ColorIdentity:
        """The folder, which stands for the camera: a body tells its serial number only with a picture.

        Pictures that come from another body, or through another focal length, than the first say so.
        """
        return self._identity

    @property
    def state(self) -> LiveState:
        """A still camera never stalls: it waits for the shutter."""
        if self._thread is None:
            return LiveState.CLOSED
        return LiveState.GONE if self._gone else LiveState.STREAMING

    @property
    def streams(self) -> bool:
        """Somebody presses the shutter."""
        return False

    @property
    def rejected(self) -> tuple[RejectedFile, ...]:
        """New files that were no usable pictures, and why."""
        with self._news:
            return tuple(self._rejected)

    def open(self) -> None:
        """Watch the folder from now on."""
        if self._thread is not None and not self._gone:
            return
        self.close()
        try:
            self._seen = {path.name: key for path, key in self._files()}
        except OSError as error:
            raise WorkError(
                f"The folder of the still camera cannot be read ({error.strerror}).",
                "Check that it exists and that the network drive or the card reader is connected.",
            ) from error
        self._stop.clear()
        self._thread = threading.Thread(target=self._watch, name="geoderm-folder-watch", daemon=True)
        self._thread.start()

    def latest(self, after: int = 0, timeout_s: float = 0.0) -> TimedPicture | None:
        """The newest picture with a number greater than ``after``."""
        found = self.since(after, timeout_s)
        return found[-1] if found else None

    def since(self, after: int, timeout_s: float) -> list[TimedPicture]:
        """The last few pictures with a number greater than ``after``, in the order of their exposure."""
        deadline = time.monotonic() + timeout_s
        with self._news:
            while True:
                if self._gone:
                    raise WorkError(self._gone, "Bring it back, then choose the camera again.")
                if self._thread is None:
                    raise WorkError("The still camera's folder is not being watched.", "Open it first.")
                newer = [p for p in self._pictures if p.number > after]
                if newer or not self._news.wait(max(0.0, deadline - time.monotonic())):
                    return sorted(newer, key=lambda p: p.time_s)

    def still(self, timeout_s: float = 10.0) -> TimedPicture:
        """The next picture whose shutter opened from now on."""
        now, deadline, after = time.monotonic(), time.monotonic() + timeout_s, self._count
        while (left := deadline - time.monotonic()) > 0:
            picture = self.latest(after, left)
            if picture is not None:
                after = picture.number
                if picture.time_s + 3 * picture.time_sigma_s >= now:
                    return picture
        told = "; ".join(f"{r.name}: {r.reason}" for r in self.rejected[-2:])
        raise WorkError(
            f"No picture came from the still camera within {timeout_s:.0f} seconds."
            + (f" Not usable: {told}." if told else ""),
            "Press its shutter; check that it saves into the watched folder.",
        )

    @property
    def mode(self) -> StreamMode | None:
        """Size of the newest picture."""
        if not self._pictures:
            return None
        height, width = self._pictures[-1].rgb.shape[:2]
        return StreamMode("color", width, height, 0, "rgb8")

    def modes(self) -> tuple[StreamMode, ...]:
        """None: the resolution is set at the camera."""
        return ()

    def choose_mode(self, mode: StreamMode) -> None:
        """Refuse: the resolution is set at the camera."""
        raise InputError("The resolution of a still camera is set at the camera.")

    def controls(self) -> tuple[CameraControl, ...]:
        """Only ``latency_s``; exposure and focus are set at the camera."""
        return (CameraControl("latency_s", self._clock.latency_s, -1.0, 5.0),)

    def set_control(self, name: str, value: float) -> None:
        """Set ``latency_s``."""
        if name != "latency_s" or not -1.0 <= value <= 5.0:
            raise InputError(f"A still camera has no setting '{name}' of {value:g}.", "Set it at the camera.")
        self._clock.latency_s = value

    def close(self) -> None:
        """Stop watching."""
        if self._thread is not None:
            self._stop.set()
            self._thread.join(10.0)
            self._thread = None
        with self._news:
            self._reset()
            self._news.notify_all()

    def _files(self) -> list[tuple[Path, tuple[int, int]]]:
        """Picture files in the folder, with size and time of change; hidden ones are somebody's scratch."""
        found = []
        for path in self._folder.iterdir():
            if path.suffix.lower() in SUFFIXES and not path.name.startswith("."):
                try:
                    status = path.stat()
                except OSError:
                    continue
                found.append((path, (status.st_size, status.st_mtime_ns)))
                if len(found) > _MOST_FILES:
                    break
        return found

    def _watch(self) -> None:
        while not self._stop.wait(POLL_S):
            now = time.monotonic()
            try:
                files = self._files()
                self._missing_since = None
            except OSError:
                self._missing_since = self._missing_since or now
                if now - self._missing_since > _GONE_AFTER_S:
                    with self._news:
                        self._gone = "The folder of the still camera is gone."
                        self._news.notify_all()
                    return
                continue
            ready = [found for path, key in files if (found := self._look(path, key, now)) is not None]
            for picture, arriving in sorted(ready, key=lambda r: (r[1].changed_ns, r[1].first_s)):
                self._take(picture, arriving)

    def _look(self, path: Path, key: tuple[int, int], now: float) -> tuple[PictureFile, _Arriving] | None:
        """The picture of a file that has just become complete."""
        if self._seen.get(path.name) == key:
            return None
        waiting = self._arriving.get(path.name)
        if waiting is None or (waiting.size, waiting.changed_ns) != key:
            first = now if waiting is None else waiting.first_s
            self._arriving[path.name] = _Arriving(*key, first, now)
            return None
        quiet_s = now - waiting.same_since_s
        if quiet_s < _SETTLED_S or (waiting.reason and quiet_s < _GIVE_UP_S):
            return None
        try:
            picture = read_picture(path)
        except Unusable as unusable:
            # A writer may pause: looked at once more before it is given up, and again when it changes.
            if not waiting.reason:
                waiting.reason = str(unusable)
                return None
            with self._news:
                self._rejected = [*self._rejected[-19:], RejectedFile(path.name, str(unusable))]
            self._seen[path.name] = key
            del self._arriving[path.name]
            return None
        self._seen[path.name] = key
        del self._arriving[path.name]
        return picture, waiting

    def _take(self, file: PictureFile, arriving: _Arriving) -> None:
        moment = self._clock.exposed(arriving.first_s, file.exposed_at)
        first = self._first = self._first or replace(file, rgb=file.rgb[:1, :1].copy())
        notes = []
        if file.turned:
            notes.append(_TURNED)
        if file.serial != first.serial or file.model != first.model:
            notes.append("The picture comes from another camera than the first one.")
        if file.focal_px and first.focal_px and abs(file.focal_px / first.focal_px - 1) > _ZOOMED:
            notes.append("The lens has been zoomed since the first picture; the calibration does not fit.")
        with self._news:
            self._count += 1
            picture = TimedPicture(
                self._count,
                moment.time_s,
                file.rgb,
                moment.sigma_s,
                file.focal_px,
                tuple(notes),
            )
            self._pictures = [*self._pictures[1 - _KEPT :], picture]
            self._news.notify_all()


class _FolderWatches:
    """Factory of ``folder-watch:PATH``, with ``?latency_s=0.8``."""

    def cameras(self) -> Sequence[ColorCameraInfo]:
        """None by themselves: a person names the folder."""
        return []

    def create(self, address: str) -> FolderWatchCamera:
        """The still camera that saves into a folder."""
        place, _, options = address.partition("?")
        latency_s = 0.0
        for name, value in parse_qsl(options, keep_blank_values=True):
            if name != "latency_s":
                raise InputError(f"A watched folder has no option '{name}'.", "It has latency_s.")
            latency_s = latency_of(value)
        folder = Path(place)
        if not place or not folder.is_dir():
            raise InputError(f"{place}: there is no such folder to watch.")
        return FolderWatchCamera(folder, latency_s)


FOLDER_WATCHES = _FolderWatches()
