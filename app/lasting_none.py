"""Keeps Python 3.11 alive under a Qt binding that was built for 3.12 and later.

From Python 3.12 on, ``None`` is immortal: nobody counts its references any more. PySide6 6.12 is built with
such headers and one build serves all versions: under 3.11 every Qt method without a result takes one
reference to ``None`` away that nobody has given. After some thousand calls (a minute of a moving picture) the
interpreter aborts with "Fatal Python error: none_dealloc". Giving ``None`` more references than can ever be
taken away makes it as lasting as it is in 3.12.
"""

from __future__ import annotations

import ctypes
import sys
from typing import Final

_PLENTY: Final = 1 << 60
_FEWER: Final = 1 << 58


def keep_none() -> None:
    """Make ``None`` last. Quick; calling it again does nothing."""
    if sys.version_info >= (3, 12) or sys.implementation.name != "cpython":
        return
    if sys.getrefcount(None) < _FEWER:
        # the count is the first field of every object (CPython, Include/object.h)
        ctypes.c_ssize_t.from_address(id(None)).value = _PLENTY
