"""The two captures of a relocation and the anchors they share."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from core.anchors import AnalysedCapture, Anchor
from core.relocation.depth_floor import depth_excess_m2
from core.relocation.types import LesionQuery
from core.surface import SurfacePoint

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PickedLesion:
    """A lesion of the first visit on its skin."""

    query: LesionQuery
    point: SurfacePoint
    normal: FloatArray


@dataclass(frozen=True, eq=False)
class KnownPlace:
    """A place that is certain on both skins: a lesion the doctor has confirmed."""

    id: str
    first: SurfacePoint
    followup: SurfacePoint


@dataclass(frozen=True, eq=False)
class VisitPair:
    """First capture and follow-up of one person."""

    first: AnalysedCapture
    followup: AnalysedCapture

    @cached_property
    def depth_excess_m2(self) -> float:
        """Variance in square metres by which the depth of both visits errs more than a Kinect v1's."""
        return depth_excess_m2(self.first.scan) + depth_excess_m2(self.followup.scan)

    @cached_property
    def joint_names(self) -> tuple[str, ...]:
        """The thesis's joints that are reliable in both captures."""
        return _common(self.first.anchors.anchors, self.followup.anchors.anchors)

    @cached_property
    def anchor_names(self) -> tuple[str, ...]:
        """Joints and extra landmarks that are reliable in both captures."""
        return self.joint_names + _common(self.first.anchors.extra, self.followup.anchors.extra)

    def sigma_m(self, names: tuple[str, ...]) -> FloatArray:
        """What each anchor adds to the spread of a distance difference between the visits (a,)."""
        both = [[a.anchors[name].sigma_m for name in names] for a in (self.first, self.followup)]
        return np.asarray(np.sqrt((np.array(both) ** 2).mean(axis=0)).reshape(-1))

    def joints_m(self, name: str) -> tuple[FloatArray, FloatArray]:
        """Joint centre in the first capture and in the follow-up."""
        return self.first.skeleton.point(name), self.followup.skeleton.point(name)


def _common(first: tuple[Anchor, ...], followup: tuple[Anchor, ...]) -> tuple[str, ...]:
    seen = {a.name for a in followup if a.reliable}
    return tuple(a.name for a in first if a.reliable and a.name in seen)


def anchor_points(analysed: AnalysedCapture, names: tuple[str, ...]) -> dict[str, SurfacePoint]:
    """Name to skin point of some anchors of a capture."""
    return {name: analysed.anchors[name].point for name in names}
