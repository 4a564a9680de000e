"""How a body differs from one capture to the next: weight, breath, clothes, skin that slides."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from devices.simulator.body import BodyModel, PosedBody, enclosed_volume, vertex_normals

FloatArray = NDArray[np.float64]

_SLIDING_JOINTS = {
    # joint: bone whose bend drives it, limb it pulls along (from, to), reach of the field in metres
    "shoulder": ("upperarm01", "upperarm01", "lowerarm01", 0.11),
    "elbow": ("lowerarm01", "lowerarm01", "wrist", 0.07),
    "hip": ("upperleg01", "upperleg01", "lowerleg01", 0.13),
    "knee": ("lowerleg01", "lowerleg01", "foot", 0.09),
}


_FULL_BEND = np.pi / 3


def with_weight_change(model: BodyModel, bind: FloatArray, share: float) -> FloatArray:
    """Bind vertices (n, 3) of a body whose volume has grown by ``share`` (0.05 is +5 %).

    Fat goes to belly, hips and thighs first, less to the limbs, hardly to head, hands and feet.
    """
    if share == 0.0:
        return bind
    thin = model.bone_weight("head", "neck", "wrist", "finger", "metacarpal", "foot", "toe", "eye")
    belly = model.bone_weight("spine05", "spine04", "root", "pelvis", "upperleg01")
    limbs = model.bone_weight("upperarm", "lowerarm", "lowerleg")
    gain = np.clip(0.6 + 0.8 * belly - 0.3 * limbs - 0.6 * thin, 0.0, None)
    normals = vertex_normals(bind, model.triangles)
    before = enclosed_volume(bind, model.triangles)
    step, grown = 0.004 * np.sign(share), bind
    for _ in range(4):
        grown = bind + step * gain[:, None] * normals
        step *= share * before / (enclosed_volume(grown, model.triangles) - before)
    return np.asarray(bind + step * gain[:, None] * normals)


def with_breath(model: BodyModel, bind: FloatArray, depth_m: float) -> FloatArray:
    """Bind vertices of a chest and belly lifted by up to ``depth_m``."""
    chest = model.bone_weight("spine04", "spine03", "spine02", "spine01", "clavicle")
    normals = vertex_normals(bind, model.triangles)
    front = np.clip(-normals[:, 1], 0.0, 1.0)
    return np.asarray(bind + (depth_m * chest * (0.25 + 0.75 * front))[:, None] * normals)


def with_layer(model: BodyModel, bind: FloatArray, thickness_m: FloatArray) -> FloatArray:
    """Bind vertices pushed outward by cloth or hair, thickness (n,) in metres."""
    return np.asarray(bind + thickness_m[:, None] * vertex_normals(bind, model.triangles))


def skin_slide(body: PosedBody, rng: np.random.Generator, torso_too: bool = False) -> FloatArray:
    """Tangential displacement (n, 3) of the skin over the posed body, metres.

    Near a joint bent by 60 degrees or more the skin is drawn along the limb by 3 to 8 mm, and a little
    to the side; linear-blend skinning does none of this. The field fades with the distance from the joint.
    With ``torso_too`` raised arms also draw the skin over shoulder blades and chest muscles.
    The figure itself must stay: put the result back onto the surface (`closest_on_surface` of the renderer).
    """
    model, v = body.model, body.vertices
    field = np.zeros_like(v)
    scale = model.stature_m / 1.75
    for side in ("L", "R"):
        for bone, start, end, reach in _SLIDING_JOINTS.values():
            amount = rng.uniform(0.003, 0.008) * min(body.bend.get(f"{bone}.{side}", 0.0) / _FULL_BEND, 1.0)
            sideways = rng.normal(0.0, 0.35, 3)
            if amount < 1e-5:
                continue
            origin = model.bone_point(f"{start}.{side}")
            along = model.bone_direction(f"{start}.{side}", f"{end}.{side}")
            near = np.exp(-(((model.reference - origin) ** 2).sum(1)) / (reach * scale) ** 2)
            posed = _limb_direction(body, start, side)
            field -= (amount * near)[:, None] * (posed + sideways - along * (along @ sideways))
    torso = np.sqrt(
        sum(body.bend.get(b, 0.0) ** 2 for b in ("spine05", "spine04", "spine03", "spine02", "spine01"))
    )
    if torso > 1e-3:
        centre = model.bone_point("spine03")
        near = np.exp(-(((model.reference - centre) ** 2).sum(1)) / (0.22 * scale) ** 2)
        pull = rng.normal(0.0, 1.0, 3)
        field += (rng.uniform(0.003, 0.008) * min(torso, 1.0) * near)[:, None] * pull / np.linalg.norm(pull)
    if torso_too:
        field += _drawn_by_raised_arms(body, rng)
    normals = vertex_normals(v, model.triangles)
    tangential = field - normals * (field * normals).sum(1, keepdims=True)
    fixed = model.bone_weight("finger", "metacarpal", "toe", "eye", "head")
    return np.asarray(tangential * (1.0 - fixed)[:, None])


def _drawn_by_raised_arms(body: PosedBody, rng: np.random.Generator) -> FloatArray:
    """Displacement (n, 3) over shoulder blade and chest muscle, toward the armpit and up, by 5 to 8 mm.

    It begins with the arm 30 degrees away from the trunk and is full from 90 degrees on.
    """
    model = body.model
    field = np.zeros_like(body.vertices)
    scale = model.stature_m / 1.75
    arms = model.bone_weight("upperarm", "lowerarm", "wrist", "finger", "metacarpal")
    up = body.joints["neck"] - body.joints["torso"]
    up = up / np.linalg.norm(up)
    for side, word in (("L", "left"), ("R", "right")):
        amounts = rng.uniform(0.005, 0.008, 2)
        arm = _limb_direction(body, "upperarm01", side)
        raised = np.degrees(np.arccos(np.clip(-arm @ up, -1.0, 1.0)))
        lift = float(np.clip((raised - 30.0) / 60.0, 0.0, 1.0))
        out = body.joints[f"{word}_shoulder"] - body.joints["neck"]
        out = out - up * (out @ up)
        pull = 0.7 * up + 0.7 * out / np.linalg.norm(out)
        shoulder, middle = model.bone_point(f"upperarm01.{side}"), model.bone_point("neck01")
        centre = 0.55 * shoulder + 0.45 * middle - (0.0, 0.0, 0.10 * scale)
        near = np.exp(-((model.reference - centre)[:, (0, 2)] ** 2).sum(1) / (0.10 * scale) ** 2)
        behind = (model.reference[:, 1] > centre[1]).astype(np.int64)
        reach = near * np.clip(1.0 - arms, 0.0, 1.0)
        field += (lift * amounts[behind] * reach)[:, None] * pull
    return field


def _limb_direction(body: PosedBody, bone: str, side: str) -> FloatArray:
    word = "left" if side == "L" else "right"
    ends = {
        "upperarm01": ("shoulder", "elbow"),
        "lowerarm01": ("elbow", "hand"),
        "upperleg01": ("hip", "knee"),
        "lowerleg01": ("knee", "foot"),
    }
    start, end = ends[bone]
    d = body.joints[f"{word}_{end}"] - body.joints[f"{word}_{start}"]
    return np.asarray(d / np.linalg.norm(d))
