"""The ChArUco calibration board: its geometry, and how it is found in a picture to a fraction of a pixel."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from core.errors import InputError

FloatArray = NDArray[np.float64]

PAPERS_M = {"A4": (0.297, 0.210), "A3": (0.420, 0.297)}
"""Papers a board can be printed on, landscape: width and height in metres."""

_SQUARE_M = {"A4": 0.029, "A3": 0.042}
# The marker is three quarters of its square: with its own frame of one module, a square is 8 modules wide.
_MARKER_SHARE = 0.75
_MIN_CORNERS = 8
_SEARCH_WIDTH = 1600


@dataclass(frozen=True)
class BoardSpec:
    """A chessboard with an ArUco marker in every white square.

    Board frame: origin at the outer corner of the top left square, x right, y down (as printed), z into
    the paper, so that a camera that sees the board upright and square has the board's own axes.

    Attributes
    ----------
    squares_x, squares_y : int
    square_m : float
        Side of a square, as measured on the printed board.
    marker_m : float
    dictionary : str
        Name of the ArUco dictionary.
    """

    squares_x: int = 9
    squares_y: int = 6
    square_m: float = _SQUARE_M["A3"]
    marker_m: float = _SQUARE_M["A3"] * _MARKER_SHARE
    dictionary: str = "DICT_4X4_50"

    def __post_init__(self) -> None:
        if not (3 <= self.squares_x <= 30 and 3 <= self.squares_y <= 30):
            raise InputError("A calibration board has 3 to 30 squares a side.")
        if not (0.005 <= self.square_m <= 0.5 and 0.3 * self.square_m <= self.marker_m < self.square_m):
            raise InputError(
                "The squares of a calibration board are 5 to 500 mm, its markers smaller than a square."
            )
        number = getattr(cv2.aruco, self.dictionary, None)
        if not self.dictionary.startswith("DICT_") or not isinstance(number, int):
            raise InputError(f"There is no ArUco dictionary called '{self.dictionary}'.")
        if len(_dictionary(self.dictionary).bytesList) < self.squares_x * self.squares_y // 2:
            raise InputError(f"{self.dictionary} has too few markers for this board.")

    @classmethod
    def for_paper(cls, paper: str) -> BoardSpec:
        """The board that fits a paper, "A4" or "A3"."""
        side = _SQUARE_M.get(paper.upper())
        if side is None:
            raise InputError(f"There is no board for paper '{paper}'.", "Choose A4 or A3.")
        return cls(square_m=side, marker_m=side * _MARKER_SHARE)

    def with_square(self, square_m: float) -> BoardSpec:
        """The same board as measured after printing: printers do not keep the scale exactly."""
        return replace(self, square_m=square_m, marker_m=self.marker_m * square_m / self.square_m)

    @property
    def size_m(self) -> tuple[float, float]:
        """Width and height of the printed squares."""
        return self.squares_x * self.square_m, self.squares_y * self.square_m

    @property
    def corner_count(self) -> int:
        """Inner corners."""
        return (self.squares_x - 1) * (self.squares_y - 1)

    @cached_property
    def corners_m(self) -> FloatArray:
        """Inner corners (n, 3) in the board frame, row by row; their number is their id."""
        x, y = np.meshgrid(np.arange(1, self.squares_x), np.arange(1, self.squares_y))
        return np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1).astype(float) * self.square_m

    @cached_property
    def outline_m(self) -> FloatArray:
        """Outer corners (4, 3) of the squares, clockwise from the top left as printed."""
        w, h = self.size_m
        return np.array([[0, 0, 0], [w, 0, 0], [w, h, 0], [0, h, 0]], dtype=float)

    @property
    def centre_m(self) -> FloatArray:
        """Middle (3,) of the board."""
        w, h = self.size_m
        return np.array([w / 2, h / 2, 0.0])

    def modules(self) -> NDArray[np.bool_]:
        """The print, True for black, in modules of an eighth of a square: (8 ny, 8 nx).

        Only for boards whose marker is three quarters of the square, which those of `for_paper` are.
        """
        if abs(self.marker_m / self.square_m - _MARKER_SHARE) > 1e-6:
            raise InputError("The marker must be three quarters of the square to be drawn.")
        board, dictionary = self._board, _dictionary(self.dictionary)
        bits = int(dictionary.markerSize)
        if bits != 4:
            raise InputError("Boards are drawn with 4 x 4 markers.")
        black = np.zeros((8 * self.squares_y, 8 * self.squares_x), bool)
        for row in range(self.squares_y):
            for column in range(self.squares_x):
                if (row + column) % 2 == 0:
                    black[8 * row : 8 * row + 8, 8 * column : 8 * column + 8] = True
        for number, corners in zip(board.getIds().ravel(), board.getObjPoints(), strict=True):
            x, y = np.rint(np.asarray(corners)[0, :2] / self.square_m * 8).astype(int)
            picture = cv2.aruco.generateImageMarker(dictionary, int(number), bits + 2, borderBits=1)
            black[y : y + 6, x : x + 6] = picture == 0
        return black

    @cached_property
    def _board(self) -> Any:
        return cv2.aruco.CharucoBoard(
            (self.squares_x, self.squares_y), self.square_m, self.marker_m, _dictionary(self.dictionary)
        )


@lru_cache(maxsize=4)
def _dictionary(name: str) -> Any:
    return cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name))


@lru_cache(maxsize=8)
def _detector(spec: BoardSpec, fine: bool) -> Any:
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_NONE
    parameters.minMarkerPerimeterRate = 0.015
    if fine:
        # Far boards: markers of 2 pixels a module; several thresholds find more of them.
        parameters.adaptiveThreshWinSizeMin, parameters.adaptiveThreshWinSizeMax = 5, 29
        parameters.adaptiveThreshWinSizeStep = 6
        parameters.perspectiveRemovePixelPerCell = 6
    return cv2.aruco.CharucoDetector(spec._board, cv2.aruco.CharucoParameters(), parameters)


@dataclass(frozen=True, eq=False)
class BoardView:
    """The board as found in one picture.

    Attributes
    ----------
    ids : ndarray (k,) int
        Numbers of the corners (`BoardSpec.corners_m`).
    pixels : ndarray (k, 2)
        Their places, pixel centres at integers.
    size : tuple of int
        Width and height of the picture.
    rise_px : float
        Width of the edges between black and white, in pixels (contrast over steepest slope): sharpness.
    """

    ids: NDArray[np.int64]
    pixels: FloatArray
    size: tuple[int, int]
    rise_px: float

    def __len__(self) -> int:
        return len(self.ids)

    def pick(self, keep: NDArray[np.bool_]) -> BoardView:
        """The view with some of its corners."""
        return replace(self, ids=self.ids[keep], pixels=self.pixels[keep])

    def shift_px(self, other: BoardView) -> float:
        """Median distance of common corners to another view in pixels; inf with fewer than four."""
        _, mine, theirs = np.intersect1d(self.ids, other.ids, return_indices=True)
        if len(mine) < 4:
            return float("inf")
        d = self.pixels[mine] - other.pixels[theirs]
        return float(np.median(np.hypot(d[:, 0], d[:, 1])))


def gray_picture(image: NDArray[Any]) -> NDArray[np.uint8]:
    """8-bit grey (h, w) of an RGB, grey or 16-bit infrared picture, which is stretched to its range."""
    if image.ndim == 3:
        return np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), np.uint8)
    if image.dtype == np.uint8:
        return np.asarray(image)
    low, high = np.percentile(image[::4, ::4], [0.5, 99.5])
    scaled = (image.astype(np.float32) - low) * (255.0 / max(float(high - low), 1.0))
    return np.asarray(np.clip(scaled, 0, 255), np.uint8)


def detect_board(image: NDArray[Any], spec: BoardSpec, *, thorough: bool = False) -> BoardView | None:
    """Find the board.

    The markers tell which corner is which; `core.calibration.corner_fit` then places every corner by fitting
    the known print to the picture.

    Parameters
    ----------
    image : ndarray (h, w) or (h, w, 3)
        Grey, infrared (8 or 16 bit) or RGB.
    thorough : bool
        Look for far boards too, in the picture enlarged: several times slower. For when the other camera
        has already seen the board.

    Returns
    -------
    BoardView or None
        None if fewer than eight corners are seen.
    """
    from core.calibration.corner_fit import fit_corners

    gray = gray_picture(image)
    height, width = gray.shape
    coarse, scale = gray, 1.0
    if width > _SEARCH_WIDTH:
        scale = _SEARCH_WIDTH / width
        coarse = cv2.resize(gray, (_SEARCH_WIDTH, round(height * scale)), interpolation=cv2.INTER_AREA)
    corners, ids = _detector(spec, False).detectBoard(coarse)[:2]
    if thorough and (ids is None or len(ids) < _MIN_CORNERS):
        enlarge = 2 if coarse.shape[1] <= 1300 else 1
        scale *= enlarge
        coarse = cv2.resize(coarse, None, fx=enlarge, fy=enlarge, interpolation=cv2.INTER_CUBIC)
        corners, ids = _detector(spec, True).detectBoard(coarse)[:2]
    if ids is None or len(ids) < 4:
        return None
    found = (np.asarray(corners, float).reshape(-1, 2) + 0.5) / scale - 0.5
    fitted = fit_corners(gray, spec, np.asarray(ids).ravel().astype(np.int64), found)
    if fitted is None or len(fitted[0]) < _MIN_CORNERS:
        return None
    return BoardView(fitted[0], fitted[1], (width, height), fitted[2])


def follow_board(image: NDArray[Any], spec: BoardSpec, before: BoardView | None) -> BoardView | None:
    """Find the board where it was in the frame before, which is quicker, or else anywhere.

    Parameters
    ----------
    before : BoardView or None
        The board in an earlier picture of the same camera.
    """
    from core.calibration.corner_fit import fit_corners

    gray = gray_picture(image)
    size = (gray.shape[1], gray.shape[0])
    if before is not None and before.size == size:
        fitted = fit_corners(gray, spec, before.ids, before.pixels)
        if fitted is not None and len(fitted[0]) >= max(0.9 * len(before), _MIN_CORNERS):
            return BoardView(fitted[0], fitted[1], size, fitted[2])
    return detect_board(gray, spec)
