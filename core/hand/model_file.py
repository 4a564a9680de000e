"""A learned hand as a JSON document, ``geoderm-hand-model/1``: plain numbers, checked when they are read.

Arrays are lists, null where a distance was never seen; nothing in the file is ever executed.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, BaseModel, FailFast, Field, model_validator

from core.errors import InputError
from core.hand.anchors import AnchorKind
from core.hand.dataset import LONGEST_NAME, configuration_name
from core.hand.documents import CHECKED, read_document, write_document
from core.hand.hand_model import HandModel
from core.hand.marker import dictionaries
from core.hand.model import OWN_FIELDS, POINTS, ConfigurationModel
from core.hand.names import PAIRS, POINT_NAMES
from core.hand.palm_anchors import PALM_NAMES
from core.hand.tree import ConfigurationTree

MODEL_FORMAT = "geoderm-hand-model/1"
MARKER_RANGE_M = (0.005, 0.3)

_LIMIT_BYTES = 12_000_000
_MOST_ANCHORS = 21
_MOST_CONFIGURATIONS = 50
_MOST_MODES = 40
_MOST_NODES = 20_001
_MOST_FRAMES = 1_000_000
_SUM_SLACK = 1e-3
_ANCHORS = {"marker": 4, "palm": len(PALM_NAMES)}
_LEAF_THRESHOLD = -2.0

FloatArray = NDArray[np.float64]

_Distance = Annotated[float, Field(ge=0.0, le=2.0)]
_Mean = Annotated[float, Field(ge=-1.0, le=2.0)]
_Sigma = Annotated[float, Field(gt=0.0, le=1.0)]
_Deviation = Annotated[float, Field(ge=-2.0, le=2.0)]
_Share = Annotated[float, Field(ge=0.0, le=1.0)]


def _kept_name(value: str) -> str:
    """As of a frame's labels: names are printed, and no file may send codes to a terminal."""
    try:
        kept = configuration_name(value)
    except InputError as error:
        raise ValueError(error.message) from error
    if kept != value:
        raise ValueError("has blanks around it, or accents written apart from their letters")
    return value


_Name = Annotated[str, Field(min_length=1, max_length=LONGEST_NAME), AfterValidator(_kept_name)]
_Frames = Annotated[int, Field(ge=0, le=_MOST_FRAMES)]


def write_model(path: Path, model: HandModel) -> None:
    """Write a model whole or not at all; reading gives the same numbers, bit for bit.

    Raises
    ------
    WorkError
        If it cannot be written.
    """
    tree = model.tree
    write_document(
        Path(path),
        {
            "format": MODEL_FORMAT,
            "anchors": model.anchors,
            "marker_m": model.marker_m,
            "dictionary": model.dictionary,
            "points": list(POINT_NAMES),
            "configurations": [_configuration(one) for one in model.configurations.values()],
            "tree": None if tree is None else _tree(tree),
        },
    )


def read_model(path: Path) -> HandModel:
    """Read what `write_model` wrote.

    Raises
    ------
    InputError
        Naming the file and the field, for anything that is not such a model.
    """
    document = read_document(Path(path), _Model, _LIMIT_BYTES)
    return HandModel(
        {one.name: one.model() for one in document.configurations},
        None if document.tree is None else document.tree.tree(),
        document.anchors,
        document.marker_m,
        document.dictionary,
    )


def check_marker(marker_m: float, dictionary: str) -> None:
    """Refuse a marker that cannot be: side in metres, dictionary one of ArUco's.

    Raises
    ------
    InputError
    """
    low, high = MARKER_RANGE_M
    if not low <= marker_m <= high:
        raise InputError(
            f"A marker's side is between {low} and {high} m, not {marker_m:g}.", "36 mm are 0.036."
        )
    if dictionary not in dictionaries():
        raise InputError(f"There is no ArUco dictionary '{dictionary[:40]}'.", "Use one such as DICT_4X4_50.")


def _configuration(one: ConfigurationModel) -> dict[str, object]:
    return {
        "name": one.name,
        "frames": one.frames,
        "fields": one.fields,
        "seen": one.seen.tolist(),
        "mean_m": _nulled(one.mean_m),
        "sigma_m": _nulled(one.sigma_m),
        "modes_m": one.modes_m.tolist(),
    }


def _tree(tree: ConfigurationTree) -> dict[str, object]:
    return {
        "classes": list(tree.classes),
        "left": tree.left.tolist(),
        "right": tree.right.tolist(),
        "feature": tree.feature.tolist(),
        "threshold_m": [
            float(t) if k >= 0 and np.isfinite(t) else None
            for t, k in zip(tree.threshold_m, tree.left, strict=True)
        ],
        "missing_left": tree.missing_left.tolist(),
        "share": tree.share.tolist(),
        "frames": tree.frames.tolist(),
    }


def _nulled(values: FloatArray) -> list[float | None]:
    return [None if np.isnan(x) else float(x) for x in values]


def _array(values: list[float | None]) -> FloatArray:
    return np.array([np.nan if x is None else x for x in values], dtype=float)


_Item = TypeVar("_Item")
_List = Annotated[list[_Item], FailFast()]
"""One fault is told: a file of millions of faults is not read to its end."""


class _Configuration(BaseModel):
    model_config = CHECKED
    name: _Name
    frames: _Frames
    fields: int = Field(gt=OWN_FIELDS, le=_MOST_ANCHORS + OWN_FIELDS)
    seen: _List[_Share] = Field(min_length=POINTS, max_length=POINTS)
    mean_m: _List[_Mean | None]
    sigma_m: _List[_Sigma | None]
    modes_m: _List[_List[_Deviation]] = Field(min_length=1, max_length=_MOST_MODES)

    @model_validator(mode="after")
    def _sizes(self) -> _Configuration:
        length = POINTS * self.fields + len(PAIRS)
        for name, row in (("mean_m", self.mean_m), ("sigma_m", self.sigma_m)):
            if len(row) != length:
                raise ValueError(f"{name} must hold {length} numbers for {self.fields} fields")
        if any(len(row) != length for row in self.modes_m):
            raise ValueError(f"every row of modes_m must hold {length} numbers")
        if [x is None for x in self.mean_m] != [x is None for x in self.sigma_m]:
            raise ValueError("mean_m and sigma_m must be null at the same places")
        if all(x is None for x in self.mean_m[: POINTS * self.fields]):
            raise ValueError("mean_m holds no distance from an anchor")
        return self

    def model(self) -> ConfigurationModel:
        return ConfigurationModel(
            self.name,
            self.fields,
            _array(self.mean_m),
            _array(self.sigma_m),
            np.array(self.modes_m, dtype=float),
            np.array(self.seen, dtype=float),
            self.frames,
        )


class _Tree(BaseModel):
    model_config = CHECKED
    classes: _List[_Name] = Field(min_length=2, max_length=_MOST_CONFIGURATIONS)
    left: _List[int] = Field(min_length=1, max_length=_MOST_NODES)
    right: _List[int] = Field(max_length=_MOST_NODES)
    feature: _List[Annotated[int, Field(ge=-1, lt=len(PAIRS))]] = Field(max_length=_MOST_NODES)
    threshold_m: _List[_Distance | None] = Field(max_length=_MOST_NODES)
    missing_left: _List[bool] = Field(max_length=_MOST_NODES)
    share: _List[Annotated[_List[_Share], Field(max_length=_MOST_CONFIGURATIONS)]] = Field(
        max_length=_MOST_NODES
    )
    frames: _List[_Frames] = Field(max_length=_MOST_NODES)

    @model_validator(mode="after")
    def _is_a_tree(self) -> _Tree:
        nodes = len(self.left)
        for name in ("right", "feature", "threshold_m", "missing_left", "share", "frames"):
            if len(getattr(self, name)) != nodes:
                raise ValueError(f"{name} must hold {nodes} values, as left does")
        seen: set[int] = set()
        for node in range(nodes):
            self._check_node(node, seen)
        if len(seen) != nodes - 1:
            raise ValueError("left and right leave nodes out of the tree")
        if len(set(self.classes)) != len(self.classes):
            raise ValueError("classes occur twice")
        for row in self.share:
            if len(row) != len(self.classes) or abs(sum(row) - 1.0) > _SUM_SLACK:
                raise ValueError("every row of share must hold one share for each class, 1 in sum")
        return self

    def _check_node(self, node: int, seen: set[int]) -> None:
        """Children come after their parent and have no other: then there is no way round in circles."""
        children = (self.left[node], self.right[node])
        leaf = children == (-1, -1)
        if leaf != (self.feature[node] == -1) or (leaf and self.threshold_m[node] is not None):
            raise ValueError(f"node {node} is half a leaf")
        if leaf:
            return
        for child in children:
            if not node < child < len(self.left) or child in seen:
                raise ValueError(f"node {node} has a child that makes no tree")
            seen.add(child)

    def _thresholds(self) -> FloatArray:
        """Metres (n,); without one it is asked whether the pair was measured, and all that was goes left."""
        inner = np.array(self.left) >= 0
        given = _array(self.threshold_m)
        return np.where(inner, np.where(np.isnan(given), np.inf, given), _LEAF_THRESHOLD)

    def tree(self) -> ConfigurationTree:
        return ConfigurationTree(
            tuple(self.classes),
            np.array(self.left, np.int64),
            np.array(self.right, np.int64),
            np.array(self.feature, np.int64),
            self._thresholds(),
            np.array(self.missing_left, np.bool_),
            np.array(self.share, dtype=float),
            np.array(self.frames, np.int64),
        )


class _Model(BaseModel):
    model_config = CHECKED
    format: Literal["geoderm-hand-model/1"]
    anchors: AnchorKind
    marker_m: float
    dictionary: str = Field(max_length=60)
    points: _List[str] = Field(max_length=POINTS)
    configurations: _List[_Configuration] = Field(min_length=1, max_length=_MOST_CONFIGURATIONS)
    tree: _Tree | None = None

    @model_validator(mode="after")
    def _fits_together(self) -> _Model:
        try:
            check_marker(self.marker_m, self.dictionary)
        except InputError as error:
            raise ValueError(str(error)) from error
        if tuple(self.points) != POINT_NAMES:
            raise ValueError("points: the model is of other points of the hand")
        names = [one.name for one in self.configurations]
        if len(set(names)) != len(names):
            raise ValueError("configurations: a name occurs twice")
        counts = {one.fields - OWN_FIELDS for one in self.configurations}
        if counts != {_ANCHORS[self.anchors]}:
            raise ValueError("configurations: the numbers of anchors contradict one another")
        if (self.tree is None) != (len(names) == 1):
            raise ValueError("tree: is there exactly if there are several configurations")
        if self.tree is not None and set(self.tree.classes) != set(names):
            raise ValueError("tree: its classes are not the configurations")
        return self
