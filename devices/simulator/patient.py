"""A patient who exists only in numbers: a body with moles that comes to visits and is photographed."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from functools import lru_cache
from types import MappingProxyType
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from core.capture.camera import PinholeCamera
from core.capture.rgbd import RgbdCapture
from core.capture.transform import RigidTransform
from core.errors import InputError
from core.progress import Progress, ScaledProgress, no_progress
from devices.camera import PreviewFrame
from devices.simulator.amputation import without_limbs
from devices.simulator.body import PosedBody, load_body, pose_body, rotation_about
from devices.simulator.body_hair import grow_hair
from devices.simulator.dermoscopy import png_of_simulated, render_dermoscopy
from devices.simulator.figure import skin_slide, with_breath, with_layer, with_weight_change
from devices.simulator.marks import Moles, areolae, make_moles, scatter_freckles, scatter_moles
from devices.simulator.recording import capture_truth, depth_frames, framing_distance, sway_motions
from devices.simulator.render import Exposure, Picture, render_picture
from devices.simulator.room import (
    VIEW_TURN_DEG,
    Bystander,
    Room,
    SimulatedRig,
    Variation,
    VisitChange,
    make_rig,
)
from devices.simulator.sensor import DEPTH_UNIT_M
from devices.simulator.skin import Skin, Wardrobe, make_skin
from devices.simulator.stage import Actor, Stage, closest_on_surface, room_depth, true_depth
from devices.simulator.stances import Posture, take_stance
from devices.simulator.truth import SimulatedCapture

FloatArray = NDArray[np.float64]

_FIRST_VISIT = datetime(2026, 1, 12, 10, 15, tzinfo=UTC)
_BETWEEN_VISITS = timedelta(days=91)
_PREVIEW_WIDTH = 320
_LAMP = np.array([-0.35, -0.80, -0.49])


def _key(*words: object) -> list[int]:
    """Seed material from words and numbers, the same in every run."""
    return [word if isinstance(word, int) and word >= 0 else crc32(repr(word).encode()) for word in words]


@dataclass(frozen=True, eq=False)
class _Setup:
    """The patient standing in the room."""

    stage: Stage
    depth_from_world: RigidTransform
    joints_m: dict[str, FloatArray]
    seed: int


class SimulatedPatient:
    """A person with moles. The same arguments make the same person, and the same calls the same captures.

    Parameters
    ----------
    shape : str
        One of `devices.simulator.body.SHAPES`.
    seed : int
        Skin, moles, habits.
    moles : int
        How many moles in all, lesions of interest included.
    lesions : int
        How many of them are lesions of interest ("L01"...), on bare trunk and limbs, front and back.
    freckles : int
        Small faint spots that are not moles.
    wardrobe : Wardrobe, optional
        Default: shorts, and a sports top for women and girls.
    tone : int, optional
        Row of `devices.simulator.skin.TONES`.
    changes : mapping of int to VisitChange
        What is different from a visit on.
    variation : Variation
        What nature varies from capture to capture.
    room : Room
    missing : collection of str
        Limbs lost, of `devices.simulator.amputation.LIMBS`, for example "left_forearm".
    body_hair : float
        Hair on trunk and limbs: 0 for none to 1 for dense.
    rig : SimulatedRig, optional
        Default: virtual Kinect with the 2560x1920 auxiliary camera.
    """

    def __init__(
        self,
        shape: str = "m_young_avg",
        seed: int = 0,
        moles: int = 180,
        *,
        lesions: int = 24,
        freckles: int = 400,
        wardrobe: Wardrobe | None = None,
        tone: int | None = None,
        changes: Mapping[int, VisitChange] | None = None,
        variation: Variation | None = None,
        room: Room | None = None,
        missing: Collection[str] = (),
        body_hair: float = 0.0,
        rig: SimulatedRig | None = None,
    ) -> None:
        if moles < 1 or lesions < 0 or lesions > moles:
            raise InputError("A simulated patient needs at least one mole and no more lesions than moles.")
        if not 0.0 <= body_hair <= 1.0:
            raise InputError("The body hair of a simulated patient goes from 0 to 1.")
        self.model = without_limbs(load_body(shape), missing)
        self.shape, self.seed = shape, seed
        self.wardrobe: Wardrobe = wardrobe or (
            "shorts_top" if shape.startswith("f_") or shape.endswith("_f") else "shorts"
        )
        self.changes: Mapping[int, VisitChange] = MappingProxyType(dict(changes or {}))
        self.variation = variation or Variation()
        self.room = room or Room()
        self.rig = rig or make_rig()
        self.skin = make_skin(self.model, self._rng("skin"), self.wardrobe, tone)
        self._texture = scatter_freckles(self.model, self.skin, freckles, self._rng("freckles")).joined(
            areolae(self.model, self.skin, self._rng("areolae"))
        )
        self._strands = grow_hair(self.model, self.skin, body_hair, self._rng("body hair"))
        self._first_moles = make_moles(self.model, self.skin, moles, lesions, self._rng("moles"))
        self._moles_at_visit = lru_cache(maxsize=16)(self._make_moles)

    def _rng(self, *words: object) -> np.random.Generator:
        return np.random.default_rng(_key(self.shape, self.seed, *words))

    @property
    def lesion_ids(self) -> tuple[str, ...]:
        """Ids of the lesions of interest."""
        return self._first_moles.lesion_ids

    def moles(self, visit: int = 1) -> Moles:
        """The moles the patient has at a visit."""
        return self._moles_at_visit(visit)

    def _make_moles(self, visit: int) -> Moles:
        moles = self._first_moles
        came = 0
        for number in sorted(n for n in self.changes if n <= visit):
            change, rng = self.changes[number], self._rng("change", number)
            candidates = [name for name in moles.ids if not name.startswith("L")]
            if change.vanished > len(candidates):
                raise InputError(f"Only {len(candidates)} moles can vanish at visit {number}.")
            gone = {candidates[k] for k in rng.permutation(len(candidates))[: change.vanished]}
            moles = moles.without(gone)
            if change.new_moles:
                fresh = scatter_moles(self.model, self.skin, change.new_moles, rng)
                ids = tuple(f"N{came + k + 1:02d}" for k in range(change.new_moles))
                moles, came = moles.joined(Moles(ids, fresh)), came + change.new_moles
            unknown = set(change.growth) - set(moles.ids)
            if unknown:
                raise InputError(f"There is no mole {', '.join(sorted(unknown))} to grow at visit {number}.")
            moles = moles.grown(change.growth)
            unknown = set(change.healed) - set(moles.ids)
            if unknown:
                raise InputError(f"There is no mole {', '.join(sorted(unknown))} to heal at visit {number}.")
            moles = moles.scarred(change.healed, self.model, self.skin)
        natural = self.variation
        if natural.faint_share > 0 or natural.tan > 0:
            moles = moles.faded(self._rng("faint", visit), natural.faint_share, natural.tan)
        return moles

    def _weight_change(self, visit: int) -> float:
        planned = 0.0
        for number in sorted(n for n in self.changes if n <= visit):
            share = self.changes[number].weight_change
            planned = planned if share is None else share
        if visit > 1 and self.variation.weight_share > 0:
            planned += float(self._rng("weight", visit).normal(0.0, self.variation.weight_share))
        return planned

    def posed(self, stance: str, visit: int, seed: int) -> PosedBody:
        """The patient's body in a stance: the visit's figure, breath, clothes, skin slid over joints."""
        natural, rng = self.variation, self._rng("pose", seed)
        bind = with_weight_change(self.model, self.model.bind, self._weight_change(visit))
        bind = with_breath(self.model, bind, float(rng.uniform(0.0, 1.0)) * natural.breath_m)
        bind = with_layer(
            self.model, bind, self.skin.layer_thickness(self._rng("clothes", visit), self.model)
        )
        posture = Posture(self.model, rng, natural.jitter_deg, natural.twist_deg)
        body = pose_body(self.model, take_stance(posture, stance), bind)
        if not natural.slide:
            return body
        amount = float(np.clip(rng.normal(1.0, 0.2), 0.5, 1.5))
        field = amount * skin_slide(body, self._rng("slide", stance), natural.torso_slide)
        moved = np.flatnonzero(np.linalg.norm(field, axis=1) > 2e-5)
        if len(moved) == 0:
            return body
        vertices = body.vertices.copy()
        vertices[moved] = closest_on_surface(
            body.vertices, self.model.triangles, vertices[moved] + field[moved]
        )
        return PosedBody(self.model, vertices, body.joints, body.bend)

    def capture(
        self,
        stance: str = "psi",
        view: str = "front",
        visit: int = 1,
        frames: int = 30,
        seed: int | None = None,
        distance_m: float | None = None,
        turn_deg: float = 0.0,
        joints: bool = False,
        *,
        height_m: float | None = None,
        taken_at: datetime | None = None,
        progress: Progress = no_progress,
    ) -> SimulatedCapture:
        """Stand before the cameras.

        Parameters
        ----------
        stance : str
            One of `devices.simulator.stances.STANCES`.
        view : {"front", "back", "left", "right"}
            The side that the camera sees.
        visit : int
            From 1.
        frames : int
            Depth frames.
        seed : int, optional
            Of everything that differs between two captures. Default: follows from visit, stance and view.
        distance_m : float, optional
            Camera to the patient's axis. Default: 2.3 m, or farther if the whole patient needs it.
        turn_deg : float
            Additional turn of the patient, toward the patient's own left.
        joints : bool
            Whether the capture carries the true joints as a recording would.
        height_m : float, optional
            Of the camera over the floor. Default: at the middle of the patient.
        taken_at : datetime, optional
        progress : Progress
        """
        if frames < 1:
            raise InputError("A simulated capture needs at least one frame.")
        setup = self._stand(stance, view, visit, seed, distance_m, turn_deg, height_m)
        progress(0.05, "Patient posed")
        rng = self._rng("frames", setup.seed)
        sway = self.variation.sway_m / self.model.stature_m
        motions = sway_motions(frames, sway, setup.depth_from_world, rng)
        depth = depth_frames(setup.stage, self.rig, motions, rng, ScaledProgress(progress, 0.05, 0.65))
        picture = self._picture(setup.stage, self.rig.color, visit, self._rng("picture", setup.seed))
        progress(0.95, "Picture rendered")
        truth = capture_truth(setup.stage, self.rig.rig, self.moles(visit), picture, setup.joints_m)
        capture = RgbdCapture(
            depth,
            DEPTH_UNIT_M,
            self.rig.rig,
            picture.rgb,
            view=view,
            stance=stance,
            taken_at=taken_at or _FIRST_VISIT + (visit - 1) * _BETWEEN_VISITS,
            joints_m=dict(setup.joints_m) if joints else None,
            sensor=self.rig.sensor.name,
        )
        progress(1.0, "Captured")
        return SimulatedCapture(capture, truth)

    def preview(
        self,
        stance: str = "psi",
        view: str = "front",
        visit: int = 1,
        seed: int | None = None,
        distance_m: float | None = None,
        turn_deg: float = 0.0,
    ) -> PreviewFrame:
        """Small noiseless picture and depth for a viewfinder; the arguments are those of `capture`."""
        setup = self._stand(stance, view, visit, seed, distance_m, turn_deg, None)
        sensor, color = self.rig.rig.depth, self.rig.color
        cells = setup.stage.body_cells(sensor, RigidTransform())
        room, _ = room_depth(setup.stage, sensor)
        depth = true_depth(setup.stage, sensor, room, cells, RigidTransform())[0][::4, ::4]
        share = _PREVIEW_WIDTH / color.width
        small = replace(
            color,
            width=_PREVIEW_WIDTH,
            height=round(color.height * share),
            fx=color.fx * share,
            fy=color.fy * share,
            cx=(color.cx + 0.5) * share - 0.5,
            cy=(color.cy + 0.5) * share - 0.5,
        )
        picture = self._picture(setup.stage, small, visit, self._rng("preview"))
        return PreviewFrame(np.where(depth < 8.0, depth, np.float32(0)), picture.rgb)

    def dermoscopy(self, lesion_id: str, visit: int = 1, *, size: int = 1024) -> NDArray[np.uint8]:
        """Dermoscopic picture (size, size, 3) of a mole at a visit, grown if the visit's change says so.

        Raises
        ------
        InputError
            If the patient has no such mole at this visit.
        """
        moles = self.moles(visit)
        if lesion_id not in moles.ids:
            raise InputError(f"The simulated patient has no mole '{lesion_id}' at visit {visit}.")
        row = moles.ids.index(lesion_id)
        marks = moles.marks
        return render_dermoscopy(
            _key(self.shape, self.seed, "dermoscopy", lesion_id),
            _key(self.shape, self.seed, "dermoscopy", lesion_id, visit),
            radius_mm=1e3 * float(marks.radius_m[row]),
            skin=self.skin.albedo[self.model.triangles[marks.triangle[row], 0]],
            color=marks.color[row],
            size=size,
        )

    def dermoscopy_png(self, lesion_id: str, visit: int = 1, *, size: int = 1024) -> bytes:
        """The picture of `dermoscopy` as a PNG file whose metadata says that it was simulated."""
        text = f"simulated patient {self.shape}, seed {self.seed}, lesion {lesion_id}, visit {visit}"
        return png_of_simulated(self.dermoscopy(lesion_id, visit, size=size), text)

    def _stand(
        self,
        stance: str,
        view: str,
        visit: int,
        seed: int | None,
        distance_m: float | None,
        turn_deg: float,
        height_m: float | None,
    ) -> _Setup:
        if view not in VIEW_TURN_DEG:
            raise InputError(
                f"The simulated patient has no view '{view}'.", "Choose front, back, left or right."
            )
        if visit < 1:
            raise InputError("Visits are numbered from 1.")
        seed = crc32(repr((visit, stance, view, turn_deg)).encode()) if seed is None else seed
        body = self.posed(stance, visit, seed)
        turn = rotation_about((0, 0, 1), np.deg2rad(VIEW_TURN_DEG[view] + turn_deg))
        standing = body.vertices @ turn.T
        height = 0.5 * float(standing[:, 2].max()) if height_m is None else height_m
        if distance_m is None:
            distance_m = framing_distance(standing, self.rig, self.room, height)
        depth_from_world = self.room.depth_from_world(distance_m, height)
        marks = self._texture.joined(self.moles(visit).marks)
        actors = [Actor(self.model, depth_from_world.apply(standing), self.skin, marks, self._strands)]
        if self.room.bystander is not None:
            actors.append(self._bystander(self.room.bystander, depth_from_world))
        stage = Stage(actors, self.room.planes(depth_from_world), _LAMP)
        joints_m = {name: depth_from_world.apply(turn @ p) for name, p in body.joints.items()}
        return _Setup(stage, depth_from_world, joints_m, seed)

    def _bystander(self, who: Bystander, depth_from_world: RigidTransform) -> Actor:
        model = load_body(who.shape)
        rng = self._rng("bystander", who.shape)
        skin: Skin = make_skin(model, rng, "street")
        bind = with_layer(model, model.bind, skin.layer_thickness(rng, model))
        body = pose_body(model, take_stance(Posture(model, rng, 4.0, 5.0), who.stance), bind)
        turn = rotation_about((0, 0, 1), np.deg2rad(who.turn_deg))
        world = body.vertices @ turn.T + (who.right_m, who.behind_m, 0.0)
        return Actor(model, depth_from_world.apply(world), skin, None)

    def _picture(self, stage: Stage, camera: PinholeCamera, visit: int, rng: np.random.Generator) -> Picture:
        gain = self._rng("light", visit).normal(1.0, 0.03, 3) * 1.3
        exposure = Exposure((float(gain[0]), float(gain[1]), float(gain[2])))
        return render_picture(stage, camera, self.rig.color_from_depth, exposure, rng)
