"""The house style: `apply_theme(app)` once, `palette` for colours, `icon(name, color)` for icons.

Style classes are set with `style_class(widget, "primary")` and live in ``resources/style/geoderm.qss``:

Buttons   ``primary`` (filled, one per screen), ``secondary`` (default), ``quiet`` (no frame), ``danger``,
    ``icon``.
Labels    ``title`` (26 px), ``heading`` (18 px), ``secondary``, ``caption``, ``badge``, ``badge-amber``,
          ``badge-green``, ``badge-grey``, ``field`` (form label), ``field-error``.
Frames    ``card`` (white, border, 10 px radius), ``bar`` (top bar), ``panel`` (soft background), ``line``.
"""

from app.theme import palette
from app.theme.icons import ICON_SIZE, icon, icon_pixmap
from app.theme.style import apply_theme, set_state, style_class

__all__ = ["ICON_SIZE", "apply_theme", "icon", "icon_pixmap", "palette", "set_state", "style_class"]
