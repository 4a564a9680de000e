"""Finds and loads the OpenNI2 runtime. Imported only inside the process that talks to it."""

from __future__ import annotations

import os
import sys
import tempfile
from pathlib import Path
from types import ModuleType

from core.errors import WorkError
from devices.openni.binding import load_binding

_LIBRARY = {"win32": "OpenNI2.dll", "darwin": "libOpenNI2.dylib"}.get(sys.platform, "libOpenNI2.so")


def runtime_folders() -> list[Path]:
    """Folders where the runtime may be, best first: the environment's word, then each platform's places."""
    named = [os.environ.get(k) for k in ("OPENNI2_REDIST64", "OPENNI2_REDIST")]
    folders = [Path(n) for n in named if n]
    if sys.platform == "win32":
        program_files = Path(os.environ.get("PROGRAMFILES", "C:/Program Files"))
        folders += [program_files / "OpenNI2/Redist", program_files / "OpenNI2/Tools"]
    elif sys.platform == "darwin":
        folders += [Path("/usr/local/lib/ni2"), Path("/opt/homebrew/lib/ni2"), Path("/usr/local/lib")]
    else:
        folders += sorted(Path("/usr/lib").glob("*-linux-gnu*"))
        folders += [Path(p) for p in ("/usr/lib/OpenNI2", "/usr/lib64", "/usr/lib", "/usr/local/lib")]
    return folders


def load_runtime() -> ModuleType:
    """Initialise the runtime and return the ``openni2`` binding.

    Raises
    ------
    WorkError
        If no runtime can be loaded; the message names the folders that were tried.
    """
    openni2 = load_binding()
    tried = []
    for folder in runtime_folders():
        tried.append(str(folder))
        if not (found := sorted(folder.glob(_LIBRARY + "*"))):
            continue
        try:
            _initialize(openni2, folder, found[0])
        except Exception as error:  # noqa: BLE001 - the binding raises its own and ctypes' kinds alike
            tried[-1] += f" ({str(error).splitlines()[0]})"
            continue
        return openni2
    raise WorkError(
        f"The OpenNI2 runtime was not found; looked in {', '.join(tried) or 'no folder'}.",
        "Install it (Debian, Ubuntu: apt-get install libopenni2-0) or set OPENNI2_REDIST64 to its folder.",
    )


def _initialize(openni2: ModuleType, folder: Path, library: Path) -> None:
    """Load the library by the plain name the binding insists on.

    Debian's runtime package has only ``libOpenNI2.so.0``; the plain name comes with the development package.
    The runtime finds its drivers beside the library it was loaded from, so both are linked into a folder that
    is needed only while they are loaded.
    """
    if library.name == _LIBRARY:
        openni2.initialize(str(folder))
        return
    with tempfile.TemporaryDirectory(prefix="geoderm-openni2-") as name:
        linked = Path(name)
        (linked / _LIBRARY).symlink_to(library)
        (linked / "OpenNI2").symlink_to(folder / "OpenNI2")
        openni2.initialize(str(linked))
