"""The Python binding of OpenNI2 (``primesense``, or ``openni``, which is the same code)."""

from __future__ import annotations

import ctypes
import sys
from importlib import import_module
from types import ModuleType
from typing import Any

from core.errors import WorkError

_NAMES = ("primesense", "openni")


def load_binding() -> ModuleType:
    """Import the binding's ``openni2`` module.

    Raises
    ------
    WorkError
        If neither package is installed.
    """
    package = _installed()
    if sys.version_info >= (3, 13):
        _mend_enumerations(import_module(f"{package}.utils"))
    return import_module(f"{package}.openni2")


def binding_part(name: str) -> ModuleType:
    """Another module of the binding, for example ``_openni2`` (the C interface) or ``utils``."""
    load_binding()
    return import_module(f"{_installed()}.{name}")


def _installed() -> str:
    for name in _NAMES:
        try:
            import_module(name)
        except ImportError:
            continue
        return name
    raise WorkError("The Python binding of OpenNI2 is not installed.", "Run `make setup` again.")


def _mend_enumerations(utils: ModuleType) -> None:
    """Let the binding's enumerations be made on Python 3.13.

    Its metaclass makes instances of a ctypes class while the class is still being made, which ctypes refuses
    since Python 3.13 ("abstract class"). The same instances are made here right after the class is complete.
    """
    if getattr(utils, "_geoderm_mended", False):
        return
    base: Any = type(ctypes.c_int)

    def new(cls: Any, name: str, bases: tuple[type, ...], namespace: dict[str, Any]) -> Any:
        return base.__new__(cls, name, bases, namespace)

    def init(self: Any, name: str, bases: tuple[type, ...], namespace: dict[str, Any]) -> None:
        base.__init__(self, name, bases, namespace)
        if namespace.get("__module__") == utils.__name__:
            return
        namespace["_values_"].clear()
        for key in [k for k in namespace["_names_"] if not k.startswith("_")]:
            value = namespace["_names_"][key] = namespace[key]
            setattr(self, key, self(value))
            namespace["_values_"][value] = key

    utils.CEnumMeta.__new__ = new
    utils.CEnumMeta.__init__ = init
    utils._geoderm_mended = True  # type: ignore[attr-defined]
