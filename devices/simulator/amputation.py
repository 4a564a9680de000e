"""Bodies with a missing limb: what lies beyond a cut through forearm or shank is drawn in to a stump."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import numpy as np

from core.errors import InputError
from devices.simulator.body import BodyModel

_FOREARM = ("lowerarm01", "wrist", ("lowerarm", "wrist", "finger", "metacarpal"))
_SHANK = ("lowerleg01", "foot", ("lowerleg", "foot", "toe"))
LIMBS = {
    "left_forearm": ("L", "left_hand", *_FOREARM),
    "right_forearm": ("R", "right_hand", *_FOREARM),
    "left_lower_leg": ("L", "left_foot", *_SHANK),
    "right_lower_leg": ("R", "right_foot", *_SHANK),
}
"""Limbs that may be missing, from the middle of forearm or shank on."""

_CUT = 0.45
"""Where the cut is, as a share of forearm or shank."""


def without_limbs(model: BodyModel, missing: Collection[str]) -> BodyModel:
    """The body after an amputation: the same mesh, its triangles beyond the cut shrunk to nothing.

    Vertex and triangle numbers stay. Bones stay too, so a stance still aims the limb; the joint beyond the
    cut is where the limb now ends (`BodyModel.stumps`).

    Raises
    ------
    InputError
        If there is no such limb.
    """
    for limb in missing:
        if limb not in LIMBS:
            raise InputError(
                f"The simulated patient has no limb '{limb}' to lose.", f"Choose from: {', '.join(LIMBS)}."
            )
        model = _without(model, limb)
    return model


def _without(model: BodyModel, limb: str) -> BodyModel:
    side, joint, bone, end, prefixes = LIMBS[limb]
    own = [k for k, name in enumerate(model.bones) if name.startswith(prefixes) and name.endswith(f".{side}")]
    share = (model.weights * np.isin(model.weight_bones, own)).sum(axis=1)
    start, stop = model.bone_index[f"{bone}.{side}"], model.bone_index[f"{end}.{side}"]
    bind_bones = np.linalg.inv(model.skin_from_bind)[:, :3, 3]
    changed = {}
    beyond = np.zeros(len(model.bind), bool)
    for name, vertices, origins in (
        ("bind", model.bind, bind_bones),
        ("reference", model.reference, model.bone_origin),
    ):
        axis = origins[stop] - origins[start]
        length = float(np.linalg.norm(axis))
        axis = axis / length
        along = (vertices - origins[start]) @ axis
        across = vertices - origins[start] - along[:, None] * axis
        cut = _CUT * length
        ring = (share > 0.5) & (np.abs(along - cut) < 0.02)
        radius = float(np.median(np.linalg.norm(across[ring], axis=1)))
        middle = np.median(across[ring], axis=0)
        if name == "bind":
            beyond = (share > 0.5) & (along > cut)
        # the next ``radius`` of the limb becomes half a ball, all that lies beyond it the ball's pole
        angle = np.clip((along - cut) / radius, 0.0, 1.0) * np.pi / 2
        round_off = middle + (across - middle) * np.cos(angle)[:, None]
        cap = origins[start] + (cut + 0.6 * radius * np.sin(angle))[:, None] * axis + round_off
        changed[name] = np.where(beyond[:, None], cap, vertices)
    weights, weight_bones = model.weights.copy(), model.weight_bones.copy()
    weights[beyond], weight_bones[beyond] = 0.0, start
    weights[beyond, 0] = 1.0
    corners = changed["bind"][model.triangles]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    gone = beyond[model.triangles].any(axis=1) & (area < 1e-9)
    hidden = model.parts.get("missing", np.zeros(len(gone), bool)) | gone
    return replace(
        model,
        bind=changed["bind"],
        reference=changed["reference"],
        weights=weights,
        weight_bones=weight_bones,
        parts=model.parts | {"missing": hidden},
        stumps={**model.stumps, joint: _CUT},
    )
