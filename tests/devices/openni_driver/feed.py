"""Builds the feeding driver, puts it beside the real runtime, and makes folders that it feeds from."""

from __future__ import annotations

import atexit
import functools
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from devices.openni.runtime import runtime_folders

HERE = Path(__file__).resolve().parent
HEADERS = (Path("/usr/include/openni2"), Path("/usr/local/include/openni2"))


def build_redist(target: Path) -> Path | str:
    """Folder for OPENNI2_REDIST64 with the real runtime, its drivers and ours; or the reason why not."""
    compiler = shutil.which("g++") or shutil.which("clang++")
    if compiler is None:
        return "there is no C++ compiler (apt-get install g++)"
    headers = next((h for h in HEADERS if (h / "Driver/OniDriverAPI.h").is_file()), None)
    if headers is None:
        return "the driver headers of OpenNI2 are not installed (apt-get install libopenni2-dev)"
    runtime = next(
        (lib for f in runtime_folders() for lib in sorted(f.glob("libOpenNI2.so*"))),
        None,
    )
    if runtime is None:
        return "the OpenNI2 runtime is not installed (apt-get install libopenni2-0)"
    drivers = target / "OpenNI2/Drivers"
    drivers.mkdir(parents=True)
    (target / "libOpenNI2.so").symlink_to(runtime.resolve())
    for stock in (runtime.parent / "OpenNI2/Drivers").iterdir():
        (drivers / stock.name).symlink_to(stock.resolve())
    # Debian's runtime looks for lib*.so.0, the original for lib*.so; a driver is loaded by one name only.
    debian = any(drivers.glob("*.so.0"))
    ours = drivers / ("libFeed.so.0" if debian else "libFeed.so")
    command = [compiler, "-std=c++17", "-O1", "-fPIC", "-shared", f"-I{headers}", f"-I{headers / 'Driver'}"]
    built = subprocess.run(
        [*command, str(HERE / "feed_driver.cpp"), "-o", str(ours), "-lpthread"],
        capture_output=True,
        text=True,
        check=False,
    )
    if built.returncode != 0:
        return f"the driver does not compile here: {built.stderr[:300]}"
    return target


@functools.cache
def shared_redist() -> Path | str:
    """As `build_redist`, made once in a process and removed when it ends."""
    folder = tempfile.TemporaryDirectory(prefix="geoderm-openni-driver-")
    atexit.register(folder.cleanup)
    return build_redist(Path(folder.name) / "redist")


@dataclass(frozen=True)
class FeedFolder:
    """A camera made of files.

    Attributes
    ----------
    folder : Path
    depth : ndarray (n, h, w) uint16
    color : ndarray (n, h, w, 3) uint8 or None
    infrared : ndarray (n, h, w) uint16 or None
    """

    folder: Path
    depth: np.ndarray
    color: np.ndarray | None
    infrared: np.ndarray | None

    @property
    def uri(self) -> str:
        """As the runtime opens it."""
        return f"feed://{self.folder}"

    def command(self, name: str) -> None:
        """stall, unplug, hang or crash."""
        (self.folder / name).touch()

    def undo(self, name: str) -> None:
        """Take a command back."""
        (self.folder / name).unlink(missing_ok=True)


def make_feed(folder: Path, *, color: bool = True, infrared: bool = True, **facts: object) -> FeedFolder:
    """Write a feed: a depth ramp whose left and right differ, coloured bars, an infrared ramp; two frames."""
    folder.mkdir()
    row = np.arange(640, dtype=np.uint16)
    depth = np.stack([np.tile(800 + row + 5 * i, (480, 1)) for i in range(2)]).astype(np.uint16)
    bars = np.zeros((1, 480, 640, 3), np.uint8)
    bars[..., :320, :] = (200, 10, 20)
    bars[..., 320:, :] = (10, 100, 30)
    ir = np.tile(row * 50, (1, 480, 1)).astype(np.uint16)
    depth.tofile(folder / "depth.raw")
    if color:
        bars.tofile(folder / "color.raw")
    if infrared:
        ir.tofile(folder / "ir.raw")
    told = {"name": "Kinect", "vid": "0x045e", "pid": "0x02ae", "serial": "A00363A01", **facts}
    lines = [f"{key}={value}" for key, value in told.items() if value != ""]
    (folder / "device.txt").write_text("\n".join(lines) + "\n")
    return FeedFolder(folder, depth, bars if color else None, ir if infrared else None)


def wait_until(condition: Callable[[], bool], seconds: float = 10.0) -> bool:
    """Whether the condition came true in time."""
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        if condition():
            return True
        time.sleep(0.01)
    return condition()
