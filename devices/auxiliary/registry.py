"""Which auxiliary colour cameras there are. A new kind is one file and one registration."""

from __future__ import annotations

from importlib import import_module
from typing import cast

from core.errors import InputError
from devices.auxiliary.camera import ColorCamera, ColorCameraFactory, ColorCameraInfo

_factories: dict[str, ColorCameraFactory | str] = {}


def register_color_camera(kind: str, factory: ColorCameraFactory | str) -> None:
    """Make a kind of colour camera known.

    Parameters
    ----------
    kind : str
        First part of the ids of its cameras.
    factory : ColorCameraFactory or str
        The factory, or ``"package.module:attribute"`` of it, which is imported when first needed.
    """
    if not kind or ":" in kind:
        raise ValueError("A kind of colour camera needs a name without a colon.")
    _factories[kind] = factory


def color_camera_kinds() -> list[str]:
    """Names of the registered kinds."""
    return list(_factories)


def list_color_cameras() -> list[ColorCameraInfo]:
    """Colour cameras that can be opened now."""
    return [info for kind in color_camera_kinds() for info in _factory(kind).cameras()]


def create_color_camera(camera_id: str) -> ColorCamera:
    """The colour camera with this id (``kind:address``), not opened yet.

    Raises
    ------
    InputError
        If the id names no colour camera that can exist.
    """
    kind, colon, address = camera_id.partition(":")
    if not colon:
        raise InputError(f"'{camera_id}' is not a colour camera.", "Write kind:address, such as uvc:0.")
    return _factory(kind).create(address)


def _factory(kind: str) -> ColorCameraFactory:
    factory = _factories.get(kind)
    if factory is None:
        raise InputError(
            f"There is no kind of colour camera called '{kind}'.",
            f"Choose one of: {', '.join(color_camera_kinds())}.",
        )
    if isinstance(factory, str):
        module, _, attribute = factory.partition(":")
        factory = cast(ColorCameraFactory, getattr(import_module(module), attribute))
        _factories[kind] = factory
    return factory


register_color_camera("uvc", "devices.auxiliary.uvc:UVC_CAMERAS")
register_color_camera("folder-watch", "devices.auxiliary.folder_watch:FOLDER_WATCHES")
