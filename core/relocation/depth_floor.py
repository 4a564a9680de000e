"""What noisier depth sensors add to regions and judgements that were learned with a Kinect v1.

Spreads, factors and thresholds of this room hold for the depth of a Kinect v1, whose own errors are in
them. Another sensor's skin may err more along the line of sight (`SensorModel.skin_sigma`): the excess widens
the 95 % regions, and a carried place may hang that much farther off the seen skin before it counts as hidden.
A sensor that errs less leaves everything as it was learned: regions are never narrowed by a model alone.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from core.capture.sensors import DEFAULT_SENSOR, sensor_model, sensor_of
from core.relocation.types import Estimate, Region
from core.surface import BodyScan

DEPTH_95 = 1.96
"""Interval that holds 95 % of a normal law in one dimension: depth errs along the line of sight only."""


def depth_excess_m2(scan: BodyScan) -> float:
    """Variance of the skin's depth in square metres beyond that of a Kinect v1 at the same distance; >= 0.

    A capture of an unknown sensor is taken for a Kinect v1's.
    """
    sensor, _ = sensor_of(scan.capture.sensor)
    if sensor.name == DEFAULT_SENSOR:
        return 0.0
    distance = float(np.median(scan.surface.vertices[:, 2]))
    learned = sensor_model(DEFAULT_SENSOR)
    frames = scan.fused.frames
    excess = (
        float(sensor.skin_sigma(distance, frames)) ** 2 - float(learned.skin_sigma(distance, frames)) ** 2
    )
    return max(0.0, excess)


def widened(estimate: Estimate, excess_m2: float) -> Estimate:
    """The estimate with a region for a noisier sensor; its confidence shrinks as its radius grows."""
    if excess_m2 <= 0.0 or estimate.point_m is None or estimate.radius95_m is None:
        return estimate
    more = DEPTH_95**2 * excess_m2
    radius = float(np.sqrt(estimate.radius95_m**2 + more))
    region = estimate.region
    if region is not None:
        long, short = (float(np.sqrt(axis**2 + more)) for axis in region.axes_m)
        region = Region((long, short), region.direction)
    share = min(1.0, estimate.radius95_m / radius)
    return replace(estimate, radius95_m=radius, region=region, confidence=estimate.confidence * share)
