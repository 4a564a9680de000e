"""A patient who exists only in numbers: a body with moles that comes to visits and stands before virtual cameras."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import UTC, datetime, timedelta
from functools import lru_cache
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from core.capture.rgbd import RgbdCapture
from core.capture.transform import RigidTransform
from core.errors import InputError
from core.progress import Progress, no_progress
from devices.simulator.body import PosedBody, load_body, pose_body, rotation_about
from devices.simulator.figure import skin_slide, with_breath, with_layer, with_weight_change
from devices.simulator.marks import Moles, areolae, make_moles, scatter_freckles, scatter_moles
from devices.simulator.render import (
    Actor,
    Exposure,
    Picture,
    Stage,
    closest_on_surface,
    render_picture,
    true_depth,
)
from devices.simulator.room import (
    VIEW_TURN_DEG,
    Bystander,
    Room,
    SimulatedRig,
    Variation,
    VisitChange,
    make_rig,
)
from devices.simulator.sensor import DEPTH_UNIT_M, FrameMaker, SensorView
from devices.simulator.skin import Skin, Wardrobe, make_skin
from devices.simulator.stances import Posture, take_stance
from devices.simulator.truth import CaptureTruth, SimulatedCapture

FloatArray = NDArray[np.float64]

_FIRST_VISIT = datetime(2026, 1, 12, 10, 15, tzinfo=UTC)
_BETWEEN_VISITS = timedelta(days=91)
_GRAZING_COSINE = 0.17
_FRAME_SECONDS = 1.0 / 30.0
_LAMP_FROM = (-0.45, -0.75, -0.50)
_PATIENT_MARGIN_PX = 12


def _key(*words: object) -> list[int]:
    """Seed material from words and numbers, the same in every run."""
    return [word if isinstance(word, int) and word >= 0 else crc32(repr(word).encode()) for word in words]


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
        Default: shorts, and a sports top for women.
    tone : int, optional
        Row of `devices.simulator.skin.TONES`.
    changes : mapping of int to VisitChange
        What is different from a visit on.
    variation : Variation
        What nature varies from capture to capture.
    room : Room
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
        rig: SimulatedRig | None = None,
    ) -> None:
        if moles < 1 or lesions < 0 or lesions > moles:
            raise InputError("A simulated patient needs at least one mole and no more lesions than moles.")
        self.model = load_body(shape)
        self.shape, self.seed = shape, seed
        self.wardrobe: Wardrobe = wardrobe or ("shorts_top" if shape.startswith("f_") else "shorts")
        self.changes = dict(changes or {})
        self.variation = variation or Variation()
        self.room = room or Room()
        self.rig = rig or make_rig()
        self.skin = make_skin(self.model, self._rng("skin"), self.wardrobe, tone)
        self._texture = scatter_freckles(self.model, self.skin, freckles, self._rng("freckles")).joined(
            areolae(self.model, self.skin, self._rng("areolae"))
        )
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
        """The patient's body in a stance: figure of the visit, breath, clothes, skin slid over bent joints."""
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
        field = amount * skin_slide(body, self._rng("slide", stance))
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
        distance_m: float | None = 2.3,
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
        distance_m : float or None
            Camera to the patient's axis. None: as far as needed to see the whole patient.
        turn_deg : float
            Additional turn of the patient, toward the patient's own left.
        joints : bool
            Whether the capture carries the true joints as a recording would.
        height_m : float, optional
            Of the camera over the floor. Default: at the middle of the patient.
        taken_at : datetime, optional
        progress : Progress
        """
        if view not in VIEW_TURN_DEG:
            raise InputError(
                f"The simulated patient has no view '{view}'.", "Choose front, back, left or right."
            )
        if frames < 1 or visit < 1:
            raise InputError("A simulated capture needs at least one frame, and visits are numbered from 1.")
        seed = crc32(repr((visit, stance, view, turn_deg)).encode()) if seed is None else seed
        body = self.posed(stance, visit, seed)
        turn = rotation_about((0, 0, 1), np.deg2rad(VIEW_TURN_DEG[view] + turn_deg))
        standing = body.vertices @ turn.T
        distance_m = self._framing_distance(standing) if distance_m is None else distance_m
        height = 0.5 * float(standing[:, 2].max()) if height_m is None else height_m
        depth_from_world = self.room.depth_from_world(distance_m, height)
        vertices = depth_from_world.apply(standing)
        moles = self.moles(visit)
        patient = Actor(self.model, vertices, self.skin, self._texture.joined(moles.marks))
        lamp = -np.array(_LAMP_FROM) * (-1.0, 1.0, 1.0) / np.linalg.norm(_LAMP_FROM)
        light = np.array([-lamp[0], -abs(lamp[1]), -abs(lamp[2])])
        actors = [patient]
        if self.room.bystander is not None:
            actors.append(self._bystander(self.room.bystander, depth_from_world))
        stage = Stage(actors, self.room.planes(depth_from_world), light)
        progress(0.05, "Patient posed")
        depth = self._frames(stage, frames, self._rng("frames", seed), depth_from_world, progress)
        picture = self._picture(stage, visit, self._rng("picture", seed))
        progress(0.95, "Picture rendered")
        joints_m = {name: depth_from_world.apply(turn @ p) for name, p in body.joints.items()}
        truth = self._truth(stage, vertices, moles, picture, joints_m)
        capture = RgbdCapture(
            depth,
            DEPTH_UNIT_M,
            self.rig.rig,
            picture.rgb,
            view=view,
            stance=stance,
            taken_at=taken_at or _FIRST_VISIT + (visit - 1) * _BETWEEN_VISITS,
            joints_m=dict(joints_m) if joints else None,
        )
        progress(1.0, "Captured")
        return SimulatedCapture(capture, truth)

    def _framing_distance(self, standing: FloatArray) -> float:
        camera = self.rig.sensor.camera
        middle = 0.5 * standing[:, 2].max()
        room_y = (camera.height / 2 - _PATIENT_MARGIN_PX) / camera.fy
        room_x = (camera.width / 2 - _PATIENT_MARGIN_PX) / camera.fx
        need = np.maximum(np.abs(standing[:, 2] - middle) / room_y, np.abs(standing[:, 0]) / room_x)
        return float((need - standing[:, 1]).max())

    def _bystander(self, who: Bystander, depth_from_world: RigidTransform) -> Actor:
        model = load_body(who.shape)
        rng = self._rng("bystander", who.shape)
        skin: Skin = make_skin(model, rng, "street")
        bind = with_layer(model, model.bind, skin.layer_thickness(rng, model))
        body = pose_body(model, take_stance(Posture(model, rng, 4.0, 5.0), who.stance), bind)
        turn = rotation_about((0, 0, 1), np.deg2rad(who.turn_deg))
        world = body.vertices @ turn.T + (who.right_m, who.behind_m, 0.0)
        return Actor(model, depth_from_world.apply(world), skin, None)

    def _frames(
        self,
        stage: Stage,
        count: int,
        rng: np.random.Generator,
        depth_from_world: RigidTransform,
        progress: Progress,
    ) -> NDArray[np.uint16]:
        sensor = self.rig.sensor
        camera = sensor.camera
        cells = stage.body_cells(camera, RigidTransform())
        depth, hits, pixels = true_depth(stage, camera, cells, RigidTransform())
        rays = camera.pixel_rays.reshape(-1, 3)
        _, which = stage.plane_hits(np.zeros(3), rays)
        normals = np.zeros((len(rays), 3))
        for k, plane in enumerate(stage.planes):
            normals[which == k] = plane.normal
        body = hits.t <= depth.ravel()[pixels] + 1e-6
        normals[pixels[body]] = hits.normal[body]
        length = np.maximum(np.linalg.norm(normals, axis=1) * np.linalg.norm(rays, axis=1), 1e-9)
        cosine = np.abs((normals * rays).sum(axis=1)) / length
        flat = depth.ravel().astype(float)
        seen = np.flatnonzero(np.isfinite(flat))
        shadow = np.zeros(len(rays), bool)
        projector = np.array([sensor.baseline_m, 0.0, 0.0])
        shadow[seen] = stage.blocked(projector, rays[seen] * flat[seen, None], 0.004)
        shape = depth.shape
        view = SensorView(cosine.reshape(shape).astype(np.float32), shadow.reshape(shape))
        maker = FrameMaker(sensor, view, self.rig.device_seed, rng)
        out = np.empty((count, *shape), np.uint16)
        for k, motion in enumerate(self._sway(count, rng, depth_from_world)):
            moved = true_depth(stage, camera, cells, motion)[0] if self.variation.sway_m > 0 else depth
            out[k] = maker.frame(moved)
            progress(0.05 + 0.6 * (k + 1) / count, f"Frame {k + 1} of {count}")
        return out

    def _sway(
        self, count: int, rng: np.random.Generator, depth_from_world: RigidTransform
    ) -> list[RigidTransform]:
        """Motion of the patient in each frame: an inverted pendulum about the ankles, zero in the mean."""
        keep = np.exp(-_FRAME_SECONDS / 0.4)
        angles = np.zeros((count, 2))
        state = rng.normal(size=2)
        for k in range(count):
            angles[k] = state
            state = keep * state + np.sqrt(1 - keep**2) * rng.normal(size=2)
        if count > 1:
            angles -= angles.mean(axis=0)
        else:
            angles[:] = 0.0
        angles *= self.variation.sway_m / self.model.stature_m
        ankles = depth_from_world.apply(np.array([0.0, 0.0, 0.08]))
        motions = []
        for forward, sideways in angles:
            axis = depth_from_world.rotate(np.array([forward, sideways, 0.0]))
            angle = float(np.linalg.norm(axis))
            rotation = rotation_about(axis, angle) if angle > 0 else np.eye(3)
            motions.append(RigidTransform(rotation, ankles - rotation @ ankles))
        return motions

    def _picture(self, stage: Stage, visit: int, rng: np.random.Generator) -> Picture:
        gain = self._rng("light", visit).normal(1.0, 0.03, 3) * 1.12
        exposure = Exposure((float(gain[0]), float(gain[1]), float(gain[2])))
        return render_picture(stage, self.rig.color, self.rig.color_from_depth, exposure, rng)

    def _truth(
        self,
        stage: Stage,
        vertices: FloatArray,
        moles: Moles,
        picture: Picture,
        joints_m: dict[str, FloatArray],
    ) -> CaptureTruth:
        marks, model, rig = moles.marks, self.model, self.rig.rig
        corners = vertices[model.triangles[marks.triangle]]
        points = np.einsum("kc,kcx->kx", marks.barycentric, corners)
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        depth_of = {}
        for name in ("cloth", "hair"):
            values = getattr(self.skin, name)[model.triangles[marks.triangle]]
            depth_of[name] = (values * marks.barycentric).sum(axis=1)
        bare = (depth_of["cloth"] < -marks.radius_m) & (depth_of["hair"] < -marks.radius_m)

        def sees(eye: FloatArray) -> NDArray[np.bool_]:
            toward = eye - points
            toward /= np.linalg.norm(toward, axis=1, keepdims=True)
            facing = (normal * toward).sum(axis=1) > _GRAZING_COSINE
            return bare & facing & ~stage.blocked(eye, points, 0.003)

        pixels, depth_pixels = rig.project_to_picture(points), rig.depth.project(points)
        in_color = sees(rig.picture_from_depth.inverse().translation) & rig.picture_camera.contains(
            pixels, 1.0
        )
        in_depth = sees(np.zeros(3)) & rig.depth.contains(depth_pixels, 1.0)
        pixels[~in_color], depth_pixels[~in_depth] = np.nan, np.nan
        return CaptureTruth(
            rig=rig,
            vertices_m=vertices,
            triangles=model.triangles,
            pixel_numbers=picture.pixels,
            pixel_triangle=picture.triangle,
            pixel_uv=picture.uv,
            joints_m=joints_m,
            mole_ids=moles.ids,
            mole_triangle=marks.triangle,
            mole_barycentric=marks.barycentric,
            mole_points_m=points,
            mole_pixels=pixels,
            mole_depth_pixels=depth_pixels,
            mole_visible_color=in_color,
            mole_visible_depth=in_depth,
            mole_radius_m=marks.radius_m,
        )
