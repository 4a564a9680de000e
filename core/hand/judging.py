"""Which configuration a hand is in: every learned one is tried, and the decision tree is asked about each.

Two things are known of a configuration once its points have been looked for: how badly the surface agrees
with it (points that should be there and are not, skin that goes on where it should end), and what the tree
says of the distances between the points that were found. Both must speak for it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from core.hand.fitting import HandFit
from core.hand.model import ConfigurationModel
from core.hand.tree import ConfigurationTree

FloatArray = NDArray[np.float64]

MISFIT_SCALE = 2.0
"""A configuration whose misfit is larger by this much is e times less likely."""

TREE_FLOOR = 0.1
"""Likelihood that is left to a configuration by a tree that denies it: a tree errs in one of ten frames."""

MOST_MISFIT = 20.0
"""A hand in a learned configuration has a larger misfit in 2 % of frames, even if hands of its size and shape
were never trained on; beyond it, the configuration is unknown."""

LEAST_LIKELIHOOD = 0.6
"""Below it, two configurations are about as likely, and none is told."""

_ABSENT_COST = 25.0
_END_CAP = 50.0
_END_SIGMA_M = 0.004
_SURE_SHARE, _SELDOM_SHARE = 0.8, 0.3
_BEND = 6.0
_FREE_M, _UNEXPLAINED_PER_M = 0.028, 200.0


def misfit(model: ConfigurationModel, fit: HandFit) -> float:
    """How badly a surface agrees with a configuration; 1 to 5 if it is in it.

    Mean over the points it should show: cost of the place, disagreement of what skin is left beyond it, and
    a fixed cost for a point that is absent. To it come unusual mode coefficients, and skin beyond the points
    that none of them explains.

    Parameters
    ----------
    model : ConfigurationModel
    fit : HandFit
        Of this model.
    """
    there = np.isfinite(fit.cost)
    end = np.minimum(fit.end_error_m**2 / (model.anchor_sigma_m[:, -1] ** 2 + _END_SIGMA_M**2), _END_CAP)
    cost = np.where(
        there, np.minimum(np.nan_to_num(fit.cost), _ABSENT_COST) + np.nan_to_num(end), _ABSENT_COST
    )
    due = np.clip((model.seen - _SELDOM_SHARE) / (_SURE_SHARE - _SELDOM_SHARE), 0.0, 1.0)
    weight = np.where(there, np.maximum(model.seen, _SELDOM_SHARE), due)
    if not weight.any():
        return float("inf")
    unexplained = max(fit.unexplained_m - _FREE_M, 0.0)
    return float(weight @ cost / weight.sum() + fit.b @ fit.b / _BEND + _UNEXPLAINED_PER_M * unexplained)


@dataclass(frozen=True)
class Verdict:
    """What was judged of a frame.

    Attributes
    ----------
    configuration : str or None
        None if it is unknown.
    best : str
        The likeliest, even if it is not likely enough to be told.
    likelihood : dict of str to float
        Of every configuration that was tried; they sum to 1.
    misfit : dict of str to float
    """

    configuration: str | None
    best: str
    likelihood: Mapping[str, float]
    misfit: Mapping[str, float]


def judge(
    models: Mapping[str, ConfigurationModel], tree: ConfigurationTree | None, fits: Mapping[str, HandFit]
) -> Verdict:
    """Decide between configurations.

    Parameters
    ----------
    models : dict of str to ConfigurationModel
    tree : ConfigurationTree or None
        Not needed if there is one configuration only.
    fits : dict of str to HandFit
        Of the configurations that are tried; of those that are not, nothing is said.
    """
    misfits = {name: misfit(models[name], fit) for name, fit in fits.items()}
    return decide(tree, misfits, {name: fit.pair_m for name, fit in fits.items()})


def decide(
    tree: ConfigurationTree | None, misfits: Mapping[str, float], pairs_m: Mapping[str, FloatArray]
) -> Verdict:
    """Decide by how badly configurations fit, and by the distances (105,) between their points."""
    names = list(misfits)
    logs = -np.array([misfits[name] for name in names]) / MISFIT_SCALE
    share = np.exp(logs - logs.max()) if np.isfinite(logs).any() else np.ones(len(names))
    if tree is not None:
        said = np.mean([tree.likelihood(pairs_m[name]) for name in names], axis=0)
        by_name = dict(zip(tree.classes, said, strict=True))
        share = share * np.array([TREE_FLOOR + by_name.get(name, 0.0) for name in names])
    share = share / share.sum()
    likelihood = {name: float(s) for name, s in zip(names, share, strict=True)}
    best = max(names, key=likelihood.__getitem__)
    known = misfits[best] <= MOST_MISFIT and likelihood[best] >= LEAST_LIKELIHOOD
    return Verdict(best if known else None, best, likelihood, misfits)
