"""Light on the person: too dark, too bright, uneven, coloured, or from behind."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from core.guidance.readings import Reading, unknown

BoolArray = NDArray[np.bool_]
Picture = NDArray[np.uint8]

DARK: Final = 40.0
DIM: Final = 70.0
BURNT: Final = 250
"""A channel from this level on has lost its detail."""

BURNT_SHARE: Final = 0.04
BRIGHT_SHARE: Final = 0.01
UNEVEN: Final = 1.9
"""Brightness of the brighter side over that of the darker one."""

BEHIND: Final = 2.2
"""Brightness of the room over that of the person from which light from behind is told."""

_STRIDE: Final = 3
_FEWEST: Final = 60


def luminance(picture: Picture) -> NDArray[np.float64]:
    """Brightness 0..255 of an RGB picture."""
    return np.asarray(picture @ np.array([0.299, 0.587, 0.114]))


def burnt(picture: Picture) -> BoolArray:
    """Pixels so bright that skin detail is lost: two channels at the end of their range.

    One channel alone saturates on well lit skin, whose red is strong.
    """
    return np.asarray((picture >= BURNT).sum(axis=-1) >= 2)


def light_reading(picture: Picture, person: BoolArray) -> Reading:
    """Brightness, evenness and colour of the light on the person.

    Parameters
    ----------
    picture : ndarray (h, w, 3) uint8
    person : ndarray (h, w) bool
    """
    small, on = picture[::_STRIDE, ::_STRIDE], person[::_STRIDE, ::_STRIDE]
    skin = small[on]
    if len(skin) < _FEWEST:
        return unknown("light")
    light = luminance(skin)
    level = float(np.percentile(light, 75))
    if level < DARK:
        return Reading("light", level, "level", "bad", "Too dark: switch on more light.")
    share = float(burnt(skin).mean())
    if share > BURNT_SHARE:
        return Reading(
            "light", level, "level", "bad", "Too bright: parts of the skin are white. Dim or move the lamp."
        )
    uneven = _unevenness(luminance(small), on)
    if level < DIM:
        return Reading("light", level, "level", "fair", "Rather dark: more light would help.")
    if share > BRIGHT_SHARE:
        return Reading("light", level, "level", "fair", "A little too bright: some skin is nearly white.")
    if uneven > UNEVEN:
        return Reading("light", level, "level", "fair", "Uneven light: one side of the body is in shadow.")
    cast = _cast(skin)
    if cast:
        return Reading("light", level, "level", "fair", f"Coloured light: the skin looks {cast}.")
    return Reading("light", level, "level", "good")


def backlight_reading(picture: Picture, person: BoolArray) -> Reading:
    """Whether a window or lamp shines from behind; the value is the room's brightness over the person's."""
    light, on = luminance(picture[::_STRIDE, ::_STRIDE]), person[::_STRIDE, ::_STRIDE]
    if on.sum() < _FEWEST or (~on).sum() < _FEWEST:
        return unknown("backlight")
    body = max(float(np.median(light[on])), 1.0)
    room = float(np.percentile(light[~on], 85))
    ratio = room / body
    if ratio > BEHIND and room > 150:
        say = "Light from behind: close the curtain, or turn camera and patient away from the window."
        return Reading("backlight", ratio, "ratio", "bad" if body < DIM else "fair", say)
    return Reading("backlight", ratio, "ratio", "good")


def _unevenness(light: NDArray[np.float64], on: BoolArray) -> float:
    columns = np.flatnonzero(on.any(axis=0))
    middle = int(np.median(np.nonzero(on)[1]))
    if columns[-1] - columns[0] < 4:
        return 1.0
    sides = [light[:, :middle][on[:, :middle]], light[:, middle:][on[:, middle:]]]
    if min(len(s) for s in sides) < _FEWEST // 3:
        return 1.0
    one, other = (float(np.median(s)) + 1.0 for s in sides)
    return max(one, other) / min(one, other)


def _cast(skin: Picture) -> str:
    """Colour the light gives to skin, whose red is the strongest channel in white light, of every tone."""
    red, green, blue = (float(v) + 1.0 for v in np.median(skin, axis=0))
    if blue > red:
        return "blue"
    if green > 1.08 * red:
        return "green"
    if red > 4.5 * blue:
        return "orange"
    return ""
