"""NiTE2, the skeleton tracker of the thesis, where its proprietary runtime is installed.

NiTE2 itself never ran where this was written: there is no runtime to try it with. Loading, messages, process,
structures and coordinates are tested with a library of the same C interface; the tracking is not.
"""

from __future__ import annotations

import threading
from typing import Any, Final

from core.anchors.tracked import TrackedPerson
from core.capture.camera import PinholeCamera
from core.errors import WorkError
from devices.child_process import ChildProcess
from devices.trackers.nite2_worker import serve

START_TIMEOUT_S: Final = 20.0
_GRACE_S: Final = 1.0


class Nite2Tracker:
    """A `DepthTracker` by NiTE2, in a process of its own. Safe to call from any thread.

    Parameters
    ----------
    camera : PinholeCamera, optional
        The calibrated depth camera; by default the runtime's own idea of it.
    """

    name: Final = "NiTE2"

    def __init__(self, camera: PinholeCamera | None = None) -> None:
        self._camera = camera
        self._lock = threading.Lock()
        self._process: ChildProcess | None = None

    def start(self, source: str = "") -> None:
        """Begin to follow people; see `core.anchors.tracked.DepthTracker.start`."""
        with self._lock:
            self._stop()
            self._process = ChildProcess(serve, "geoderm-nite2")
            try:
                self._ask("start", START_TIMEOUT_S, source=source)
            except WorkError:
                self._stop()
                raise

    def read(self, timeout_s: float = 2.0) -> TrackedPerson:
        """The next moment; see `core.anchors.tracked.DepthTracker.read`."""
        with self._lock:
            person = self._ask("read", timeout_s, camera=self._camera)
        if not isinstance(person, TrackedPerson):
            raise WorkError("NiTE2 answered with something else than a person.")
        return person

    def close(self) -> None:
        """End the process. Closing twice does nothing."""
        with self._lock:
            self._stop()

    @property
    def pid(self) -> int | None:
        """Process id, for diagnosis."""
        return None if self._process is None else self._process.pid

    def _ask(self, operation: str, timeout_s: float, **arguments: object) -> Any:
        if self._process is None:
            raise WorkError("The NiTE2 tracker was not started.")
        pipe = self._process.pipe
        try:
            pipe.send((operation, arguments))
            if not pipe.poll(timeout_s):
                self._stop()
                raise WorkError(
                    f"NiTE2 did not answer for {timeout_s:.0f} seconds.",
                    "Check the camera's cable, then start the tracker again.",
                )
            answer = pipe.recv()
        except (EOFError, OSError) as error:
            self._stop()
            raise WorkError(
                "NiTE2 crashed; nothing else was harmed.", "Start the tracker again, or use MediaPipe."
            ) from error
        if answer[0] == "done":
            return answer[1]
        raise WorkError(answer[1], answer[2])

    def _stop(self) -> None:
        process, self._process = self._process, None
        if process is not None:
            process.end(_GRACE_S)
