"""Embedded deformation of the first skin onto the follow-up's: Gauss-Newton with a sparse Cholesky factor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, solveh_banded

from core.errors import WorkError
from core.relocation.registration.graph import DeformationGraph
from core.relocation.registration.start import SkeletonStart
from core.surface import BodySurface

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]

DOUBT_M = 0.010
"""A sample this far from the follow-up's skin counts half."""
SLIDE = 0.01
"""Weight of the distance along the skin against the one across it: skin may slide on the shape."""
FACING = 0.2
"""Cosine to the camera below which carried skin has no counterpart.

It has turned out of the view; the rim that it leaves would pull a limb back that has turned about its axis.
"""
TURNING_M2 = 0.1 * 0.045**2
"""Resistance of neighbouring nodes to turning against each other, beside that of their edge to stretching."""
DAMPING = 1e-4
SETTLED_M = 2e-4
"""A round that moves no node farther ends its stage."""


@dataclass(frozen=True)
class Stage:
    """One part of the schedule.

    Attributes
    ----------
    stiffness : float
        Weight of rigidity.
    reach_m : float
        Skin farther away does not correspond.
    cosine : float
        Least cosine between normals that correspond.
    joints : float
        Weight of the joints.
    rounds : int
    slip_m : float
        Stretch at which an edge lets go.
    """

    stiffness: float
    reach_m: float
    cosine: float
    joints: float
    rounds: int
    slip_m: float = 1e3


@dataclass(frozen=True, eq=False)
class Landmarks:
    """Places of the first skin whose place on the follow-up is known.

    Attributes
    ----------
    places : ndarray (k, 3)
    targets : ndarray (k, 3)
    weights : ndarray (k,)
    """

    places: FloatArray
    targets: FloatArray
    weights: FloatArray


@dataclass(frozen=True, eq=False)
class Fit:
    """How well the skins lie on each other.

    Attributes
    ----------
    rms_m : float
        Of distances across the skin, cut at 30 mm.
    covered : float
        Share of the first skin's samples that found their counterpart.
    """

    rms_m: float
    covered: float


class EmbeddedDeformation:
    """A graph with the present place and turn of its nodes.

    Parameters
    ----------
    graph : DeformationGraph
    start : SkeletonStart
    """

    def __init__(self, graph: DeformationGraph, start: SkeletonStart) -> None:
        self.graph = graph
        surface = graph.surface
        self._samples = graph.samples[graph.inner]
        self._first = surface.vertices[self._samples]
        self._first_normals = surface.normals[self._samples]
        self._carriers, self._weights = graph.attach(self._first)
        self._start = start
        turned, moved = start(self._first)
        self._rest, self._rest_normals = moved, np.einsum("kij,kj->ki", turned, self._first_normals)
        self._node_first = surface.vertices[graph.node_vertices]
        self.node_rest = start(self._node_first)[1]
        self.node_now = self.node_rest.copy()
        self.rotation = np.tile(np.eye(3), (len(self.node_rest), 1, 1))
        self._node_turn = np.ascontiguousarray(start(self._node_first)[0])
        self._skeleton_turn = np.tile(np.eye(3), (len(self.node_rest), 1, 1))
        self._prewarped = True
        self._links = np.ascontiguousarray(graph.edges[graph.edges[:, 0] < graph.edges[:, 1]])
        self._bandwidth = self._band()

    def _band(self) -> int:
        nodes = self._carriers
        spread = int((nodes.max(axis=1) - nodes.min(axis=1)).max()) if len(nodes) else 0
        edges = self.graph.edges
        if len(edges):
            spread = max(spread, int(np.abs(edges[:, 0] - edges[:, 1]).max()))
        return 6 * spread + 5

    def return_to_rest(self) -> None:
        """Make the first skin itself the rest state, keeping the present fit."""
        self.rotation = np.ascontiguousarray(np.einsum("kij,kjl->kil", self.rotation, self._node_turn))
        self._skeleton_turn = self._node_turn
        self.node_rest = self._node_first
        self._rest, self._rest_normals = self._first, self._first_normals
        self._prewarped = False

    def rest_of(self, places: FloatArray) -> FloatArray:
        """Places (k, 3) of the first skin in the present rest state."""
        return self._start(places)[1] if self._prewarped else places

    def warp(self, places: FloatArray, normals: FloatArray | None = None) -> tuple[FloatArray, FloatArray]:
        """Where first-visit places (k, 3) and their normals (k, 3) are carried to."""
        from core.relocation.registration.equation_kernels import turn_normals, warp_places

        carriers, weights = self.graph.attach(places)
        rest = self.rest_of(places)
        moved = warp_places(
            np.ascontiguousarray(rest), carriers, weights, self.rotation, self.node_rest, self.node_now
        )
        if normals is None:
            return moved, np.zeros_like(moved)
        if self._prewarped:
            normals = np.einsum("kij,kj->ki", self._start(places)[0], normals)
        return moved, turn_normals(np.ascontiguousarray(normals), carriers, weights, self.rotation)

    def solve(
        self,
        target: BodySurface,
        stages: Sequence[Stage],
        joints: Landmarks,
        landmarks: Landmarks | None = None,
    ) -> Fit:
        """Go through a schedule.

        Parameters
        ----------
        target : BodySurface
            The follow-up's skin.
        joints : Landmarks
            Weighted by each stage's `Stage.joints`.
        landmarks : Landmarks, optional
            Places with weights of their own.
        """
        fixed = [(joints, *self._attached(joints))]
        if landmarks is not None and len(landmarks.places):
            fixed.append((landmarks, *self._attached(landmarks)))
        fit = Fit(float("inf"), 0.0)
        for stage in stages:
            for _ in range(stage.rounds):
                fit, moved = self._round(target, stage, fixed)
                if moved < SETTLED_M:
                    break
        return fit

    def _attached(self, landmarks: Landmarks) -> tuple[FloatArray, IntArray, FloatArray]:
        carriers, weights = self.graph.attach(landmarks.places)
        return np.ascontiguousarray(self.rest_of(landmarks.places)), carriers, weights

    def _round(
        self,
        target: BodySurface,
        stage: Stage,
        fixed: list[tuple[Landmarks, FloatArray, IntArray, FloatArray]],
    ) -> tuple[Fit, float]:
        from core.relocation.registration.equation_kernels import (
            add_places,
            add_stiffness,
            apply_step,
            turn_normals,
            warp_places,
        )

        state = (self.rotation, self.node_rest, self.node_now)
        here = warp_places(self._rest, self._carriers, self._weights, *state)
        normals = turn_normals(self._rest_normals, self._carriers, self._weights, self.rotation)
        nearest = target.vertices_within(here, stage.reach_m)
        found = nearest >= 0
        index = np.maximum(nearest, 0)
        found &= (np.einsum("ki,ki->k", normals, target.normals[index]) > stage.cosine) & ~target.boundary[
            index
        ]
        found &= np.einsum("ki,ki->k", normals, here) < -FACING * np.linalg.norm(here, axis=1)
        gap = np.einsum("ki,ki->k", target.normals[index], here - target.vertices[index])
        weight = np.where(found, 1.0 / (1.0 + (gap / DOUBT_M) ** 2), 0.0)
        size = 6 * len(self.node_now)
        band = np.zeros((self._bandwidth + 1, size), order="F")
        right = np.zeros(size)
        add_places(
            self._rest,
            self._carriers,
            self._weights,
            target.normals[index],
            target.vertices[index],
            weight,
            SLIDE * weight,
            *state,
            band,
            right,
        )
        for number, (marks, rest, carriers, weights) in enumerate(fixed):
            strength = marks.weights * (stage.joints if number == 0 else 1.0)
            nothing = np.zeros(len(rest))
            add_places(
                rest,
                carriers,
                weights,
                np.zeros_like(rest),
                marks.targets,
                nothing,
                strength,
                *state,
                band,
                right,
            )
        add_stiffness(
            self._links,
            stage.stiffness,
            stage.slip_m,
            TURNING_M2,
            self.rotation,
            self._skeleton_turn,
            self.node_rest,
            self.node_now,
            band,
            right,
        )
        band[0] += DAMPING
        try:
            step = solveh_banded(
                band, right, overwrite_ab=True, overwrite_b=True, lower=True, check_finite=False
            )
        except LinAlgError as error:
            raise WorkError("The registration of the two surfaces did not converge.") from error
        apply_step(step, self.rotation, self.node_now)
        moved = float(np.abs(step.reshape(-1, 6)[:, 3:]).max(initial=0.0))
        rms = (
            float(np.sqrt(np.mean(np.minimum(np.abs(gap[found]), 0.03) ** 2)))
            if found.any()
            else float("inf")
        )
        return Fit(rms, float(found.mean()) if len(found) else 0.0), moved
