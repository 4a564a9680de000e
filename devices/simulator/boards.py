"""Calibration boards before any rig: pictures with blur, noise, distortion and vignetting, and raw depth."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from core.calibration.board import BoardSpec
from core.calibration.profile import DepthCorrection
from core.capture.camera import PinholeCamera
from core.capture.rgbd import CameraRig
from core.capture.sensors import DEFAULT_SENSOR, SensorModel, sensor_model
from core.capture.transform import RigidTransform
from devices.simulator.sensor import FrameMaker, SensorView

FloatArray = NDArray[np.float64]
Image = NDArray[np.float32]

_MODULE_PX = 24
_MARGIN_SQUARES = 0.5
_WALL_M = 3.2
_SMEAR_PX = 0.3
_WHITE, _BLACK = 0.80, 0.05


@dataclass(frozen=True)
class PictureQuality:
    """How one camera renders the board.

    Attributes
    ----------
    blur_px : float
        Of the lens, standard deviation.
    noise : float
        Of full scale, at white.
    vignetting : float
        Loss of light in the corner of the picture.
    gamma : float
        1 for a sensor that answers in proportion.
    """

    blur_px: float = 0.75
    noise: float = 0.010
    vignetting: float = 0.35
    gamma: float = 2.2


@dataclass(frozen=True)
class BoardRig:
    """True cameras before which a board is held.

    Attributes
    ----------
    rig : CameraRig
        With a colour camera.
    depth_error : DepthCorrection
        What a perfect calibration would find: true depth = offset + scale * measured.
    sensor : SensorModel
        Noise of the depth frames; its camera is not used.
    device_seed : int
        Fixes the ripple of the depth.
    color_quality, infrared_quality : PictureQuality
    """

    rig: CameraRig
    depth_error: DepthCorrection = field(default_factory=DepthCorrection)
    sensor: SensorModel = field(default_factory=lambda: sensor_model(DEFAULT_SENSOR))
    device_seed: int = 0
    color_quality: PictureQuality = field(default_factory=PictureQuality)
    infrared_quality: PictureQuality = field(
        default_factory=lambda: PictureQuality(blur_px=0.8, noise=0.02, vignetting=0.45, gamma=1.0)
    )


@dataclass(frozen=True, eq=False)
class BoardPictures:
    """What the cameras see at one moment; None for streams that were not asked for."""

    rgb: NDArray[np.uint8] | None
    infrared: NDArray[np.uint8] | None
    depth: NDArray[np.uint16] | None


def random_board_rig(seed: int, color_size: tuple[int, int] = (640, 480)) -> BoardRig:
    """A plausible Kinect as it comes from the shop: every parameter is a little off its nominal value.

    With 640 x 480 the colour camera is the built-in one; any other size is an auxiliary camera mounted
    beside it, up to 1.5 degrees askew.
    """
    rng = np.random.default_rng((0xB0A4D, seed))

    def off(scale: float) -> float:
        return float(np.clip(rng.normal(0.0, scale), -2 * scale, 2 * scale))

    focal = 575.8 * (1 + off(0.01))
    depth = PinholeCamera(
        640, 480, focal, focal * (1 + off(0.001)), 319.5 + off(4.0), 239.5 + off(4.0),
        (-0.06 + off(0.03), 0.12 + off(0.05), off(0.0005), off(0.0005), 0.0),
    )  # fmt: skip
    w, h = color_size
    focal = 525.0 * max(w / 640, h / 480) * (1 + off(0.01))
    color = PinholeCamera(
        w, h, focal, focal * (1 + off(0.001)),
        (w - 1) / 2 + off(0.008) * w, (h - 1) / 2 + off(0.008) * h,
        (0.08 + off(0.05), -0.16 + off(0.06), off(0.0008), off(0.0008), 0.02 + off(0.02)),
    )  # fmt: skip
    if color_size == (640, 480):
        place, turn = np.array([-0.025 + off(0.001), off(0.0005), off(0.001)]), off(0.006)
    else:
        place = np.array([rng.choice((-1.0, 1.0)) * 0.04, -0.03 + off(0.01), off(0.006)])
        turn = float(rng.uniform(0.3, 1.5)) * np.pi / 180
    axis = rng.normal(size=3)
    rotation, _ = cv2.Rodrigues(turn * axis / np.linalg.norm(axis))
    error = DepthCorrection(1 + off(0.006), off(0.005))
    return BoardRig(
        CameraRig(depth, color, RigidTransform(np.asarray(rotation, float), place)), error, device_seed=seed
    )


class BoardRenderer:
    """Renders one board before one rig.

    Parameters
    ----------
    board_rig : BoardRig
    spec : BoardSpec
        As really printed.
    seed : int
        Of the noise.
    """

    def __init__(self, board_rig: BoardRig, spec: BoardSpec, seed: int = 0) -> None:
        if board_rig.rig.color is None:
            raise ValueError("a board rig needs a colour camera")
        self.board_rig, self.spec = board_rig, spec
        self._rng = np.random.default_rng((0xB0A, seed))
        self._pyramid = _texture_pyramid(spec)
        self._color = _Eye(board_rig.rig.color, board_rig.color_quality)
        self._infrared = _Eye(board_rig.rig.depth, board_rig.infrared_quality)
        self._depth_rays = board_rig.rig.depth.pixel_rays.astype(np.float32)
        self._depth_length = np.linalg.norm(self._depth_rays, axis=2)
        self._sensor = replace(board_rig.sensor, depth_camera=board_rig.rig.depth)

    def render(
        self,
        depth_from_board: RigidTransform,
        streams: Collection[str] = ("depth", "color", "infrared"),
        motion: RigidTransform | None = None,
    ) -> BoardPictures:
        """Pictures of the board at a pose.

        Parameters
        ----------
        depth_from_board : RigidTransform
        streams : collection of str
            Which of depth, color and infrared to make.
        motion : RigidTransform, optional
            Motion of the board in the depth camera's frame while the shutter is open.
        """
        rig = self.board_rig.rig
        moving = depth_from_board if motion is None else motion @ depth_from_board
        rgb = infrared = depth = None
        if "color" in streams:
            color_from_depth = rig.picture_from_depth
            tone = self._tone(self._color, color_from_depth @ depth_from_board, color_from_depth @ moving)
            tint = np.array([1.0, 0.985, 0.96], np.float32)
            noise = self._color.grain(self._rng, 3) * np.float32(255 * self.board_rig.color_quality.noise)
            noise += tone[..., None] * (255 * tint)
            rgb = np.clip(noise, 0, 255, out=noise).astype(np.uint8)
        if "infrared" in streams:
            tone = self._tone(self._infrared, depth_from_board, moving)
            noise = self._infrared.grain(self._rng, 1)[..., 0] * np.float32(
                255 * self.board_rig.infrared_quality.noise
            )
            noise += 255 * tone
            infrared = np.clip(noise, 0, 255, out=noise).astype(np.uint8)
        if "depth" in streams:
            depth = self._depth(depth_from_board)
        return BoardPictures(rgb, infrared, depth)

    def _tone(self, eye: _Eye, start: RigidTransform, end: RigidTransform) -> Image:
        tone: Image = eye.see(self._pyramid, self.spec, start)
        if end is not start:
            centre = self.spec.centre_m[None]
            shift = eye.camera.project(end.apply(centre)) - eye.camera.project(start.apply(centre))
            smear = float(np.hypot(*shift[0]))
            steps = int(min(np.ceil(smear) + 1, 8))
            if smear > _SMEAR_PX:
                # Between two poses a board moves nearly as a line: a few moments of it make the smear.
                for k in range(1, steps):
                    share = k / (steps - 1)
                    tone = tone + eye.see(self._pyramid, self.spec, _between(start, end, share))
                tone = np.asarray(tone / np.float32(steps))
        return eye.develop(tone)

    def _depth(self, depth_from_board: RigidTransform) -> NDArray[np.uint16]:
        rays = self._depth_rays
        x, y, z = _on_board(rays, depth_from_board)
        paper = _on_paper(x, y, z, self.spec)
        true = np.where(paper, z, _WALL_M).astype(np.float32)
        normal = depth_from_board.rotation[:, 2]
        facing = np.abs(rays @ normal.astype(np.float32))
        cosine = np.where(paper, facing, np.float32(1)) / self._depth_length
        shadow = cv2.resize(
            self._shadow(rays[::2, ::2], depth_from_board).view(np.uint8),
            paper.shape[::-1],
            interpolation=cv2.INTER_NEAREST,
        )
        error = self.board_rig.depth_error
        told = ((true - error.offset_m) / error.scale).astype(np.float32)
        view = SensorView(told, cosine.astype(np.float32), (shadow > 0) & ~paper)
        return FrameMaker(self._sensor, view, self.board_rig.device_seed, self._rng).frame(told)

    def _shadow(self, rays: Image, depth_from_board: RigidTransform) -> NDArray[np.bool_]:
        """Wall that the projector does not reach because the board stands between."""
        projector = np.array([self._sensor.baseline_m, 0.0, 0.0])
        toward = (rays * np.float32(_WALL_M)) - projector.astype(np.float32)
        board_from_depth = depth_from_board.inverse()
        eye, d = board_from_depth.apply(projector), board_from_depth.rotate(toward)
        with np.errstate(divide="ignore", invalid="ignore"):
            s = -eye[2] / d[..., 2]
        x, y = eye[0] + s * d[..., 0], eye[1] + s * d[..., 1]
        return _on_paper(x, y, np.where((s > 0) & (s < 1), 1.0, -1.0), self.spec)


class _Eye:
    """One camera with its lens: rays of a finer grid, vignetting, background."""

    def __init__(self, camera: PinholeCamera, quality: PictureQuality) -> None:
        self.camera, self.quality = camera, quality
        self.fine = 2 if camera.width < 1200 else 1
        f = self.fine
        sampled = PinholeCamera(
            camera.width * f, camera.height * f, camera.fx * f, camera.fy * f,
            (camera.cx + 0.5) * f - 0.5, (camera.cy + 0.5) * f - 0.5, camera.distortion,
        )  # fmt: skip
        self.rays = _smooth_rays(sampled)
        u = (np.arange(camera.width) - camera.cx) / (camera.width / 2)
        v = (np.arange(camera.height) - camera.cy) / (camera.width / 2)
        r2 = (u[None, :] ** 2 + v[:, None] ** 2) / (1 + (camera.height / camera.width) ** 2)
        self.light = (1 - quality.vignetting * r2).astype(np.float32)
        self._sheet: Image | None = None
        rng = np.random.default_rng((0x3A11, camera.width))
        small = rng.random((9, 12), dtype=np.float32)
        self.wall = (
            0.22 + 0.25 * cv2.resize(small, (camera.width, camera.height), interpolation=cv2.INTER_CUBIC)
        ).astype(np.float32)

    def see(self, pyramid: Sequence[Image], spec: BoardSpec, camera_from_board: RigidTransform) -> Image:
        """Linear tone (h, w) of board and wall, before the lens."""
        f, tone = self.fine, self.wall.copy()
        margin = _MARGIN_SQUARES * spec.square_m
        w, h = spec.size_m
        paper = np.array(
            [
                [-margin, -margin, 0],
                [w + margin, -margin, 0],
                [w + margin, h + margin, 0],
                [-margin, h + margin, 0],
            ]
        )
        edge = np.linspace(0, 1, 9)[:, None]
        rim = np.concatenate([paper[k] + edge * (paper[(k + 1) % 4] - paper[k]) for k in range(4)])
        corners = camera_from_board.apply(rim)
        if (corners[:, 2] < 0.05).any():
            return np.asarray(tone)
        pixels = self.camera.project(corners)
        low = np.floor(pixels.min(axis=0) - 2).astype(int)
        high = np.ceil(pixels.max(axis=0) + 3).astype(int)
        u0, v0 = max(low[0], 0), max(low[1], 0)
        u1, v1 = min(high[0], self.camera.width), min(high[1], self.camera.height)
        if u1 <= u0 or v1 <= v0:
            return np.asarray(tone)
        x, y, z = _on_board(self.rays[v0 * f : v1 * f, u0 * f : u1 * f], camera_from_board)
        side = np.abs(np.median(z)) / (self.camera.fx * f)
        texel = spec.square_m / (8 * _MODULE_PX)
        level = int(np.clip(np.ceil(np.log2(max(side / texel, 1.0))), 0, len(pyramid) - 1))
        scale = 1.0 / (texel * 2**level)
        tu = ((x + margin) * scale - 0.5).astype(np.float32)
        tv = ((y + margin) * scale - 0.5).astype(np.float32)
        board = cv2.remap(
            pyramid[level], tu, tv, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=-1.0
        )
        cover = ((board >= 0) & (z > 0)).astype(np.float32)
        board = np.maximum(board, 0.0) * cover
        if f > 1:
            size = (u1 - u0, v1 - v0)
            board = cv2.resize(board, size, interpolation=cv2.INTER_AREA)
            cover = cv2.resize(cover, size, interpolation=cv2.INTER_AREA)
        part = tone[v0:v1, u0:u1]
        part *= 1 - cover
        part += board
        return np.asarray(tone)

    def grain(self, rng: np.random.Generator, channels: int) -> Image:
        """Unit noise (h, w, channels): a random piece of a larger sheet, cheaper than fresh noise."""
        h, w = self.camera.height, self.camera.width
        if self._sheet is None:
            self._sheet = rng.standard_normal(((h + 128) * (w + 128) * channels,), dtype=np.float32)
        count = h * w * channels
        start = int(rng.integers(0, len(self._sheet) - count))
        return self._sheet[start : start + count].reshape(h, w, channels).copy()

    def develop(self, tone: Image) -> Image:
        """Lens and sensor response: tone (h, w) in 0..1 without noise."""
        blurred = cv2.GaussianBlur(tone, (0, 0), self.quality.blur_px) * self.light
        if self.quality.gamma == 1.0:
            return np.asarray(blurred, np.float32)
        return np.asarray(cv2.pow(np.clip(blurred, 0.0, 1.0), 1.0 / self.quality.gamma), np.float32)


def _smooth_rays(camera: PinholeCamera) -> Image:
    """Rays (h, w, 3) of every pixel, solved on every eighth and interpolated: a lens is smooth."""
    step = 8
    u = np.arange(-step, camera.width + 2 * step, step, dtype=float)
    v = np.arange(-step, camera.height + 2 * step, step, dtype=float)
    grid = np.stack(np.meshgrid(u, v), axis=-1)
    coarse = camera.rays(grid.reshape(-1, 2)).reshape(*grid.shape[:2], 3).astype(np.float32)
    at_u = (np.arange(camera.width, dtype=np.float32) + step) / step
    at_v = (np.arange(camera.height, dtype=np.float32) + step) / step
    map_u, map_v = np.meshgrid(at_u, at_v)
    # Bilinear between knots errs by curvature * step^2 / 8: under 0.001 px for the lenses used here.
    return np.asarray(cv2.remap(coarse, map_u, map_v, cv2.INTER_LINEAR), np.float32)


@lru_cache(maxsize=4)
def _texture_pyramid(spec: BoardSpec) -> list[Image]:
    """The printed paper in linear tone, at full size and halved again and again."""
    black = np.kron(spec.modules(), np.ones((_MODULE_PX, _MODULE_PX), bool))
    margin = round(_MARGIN_SQUARES * 8 * _MODULE_PX)
    paper = np.full((black.shape[0] + 2 * margin, black.shape[1] + 2 * margin), _WHITE, np.float32)
    paper[margin:-margin, margin:-margin][black] = _BLACK
    levels = [paper]
    while min(levels[-1].shape) > 64:
        h, w = levels[-1].shape
        levels.append(cv2.resize(levels[-1], (w // 2, h // 2), interpolation=cv2.INTER_AREA))
    return levels


def _on_board(rays: NDArray[np.floating], camera_from_board: RigidTransform) -> tuple[Image, Image, Image]:
    """Board coordinates x, y and depth z (h, w) where rays meet the board's plane."""
    r, t = camera_from_board.rotation, camera_from_board.translation
    m = np.linalg.inv(np.column_stack([r[:, 0], r[:, 1], t]))
    flat = cv2.transform(np.ascontiguousarray(rays), m.astype(rays.dtype))
    with np.errstate(divide="ignore"):
        z = 1.0 / flat[..., 2]
    return flat[..., 0] * z, flat[..., 1] * z, z


def _on_paper(x: Image, y: Image, z: Image, spec: BoardSpec) -> NDArray[np.bool_]:
    margin = _MARGIN_SQUARES * spec.square_m
    w, h = spec.size_m
    return np.asarray((z > 0) & (x > -margin) & (y > -margin) & (x < w + margin) & (y < h + margin))


def _between(start: RigidTransform, end: RigidTransform, share: float) -> RigidTransform:
    turn = cv2.Rodrigues(end.rotation @ start.rotation.T)[0] * share
    return RigidTransform(
        np.asarray(cv2.Rodrigues(turn)[0]) @ start.rotation,
        start.translation + share * (end.translation - start.translation),
    )


def good_poses(
    board_rig: BoardRig,
    spec: BoardSpec,
    count: int,
    seed: int = 0,
    range_m: tuple[float, float] = (0.55, 1.35),
) -> list[RigidTransform]:
    """Poses (depth camera from board) as a person who follows the guidance holds a board.

    Spread over the common picture of both cameras, over distances and over tilts up to 45 degrees; nearly all
    of the board is in both pictures.
    """
    rng = np.random.default_rng((0x605E, seed))
    rig = board_rig.rig
    poses: list[RigidTransform] = []
    tilts = [(0.0, 0.0), (35.0, 0.0), (-35.0, 0.0), (0.0, 35.0), (0.0, -35.0)]
    tries = 0
    while len(poses) < count and tries < 4000:
        k = len(poses)
        tries += 1
        near, far = range_m
        place = ((k % 4 + rng.uniform(0.1, 0.9)) / 4, ((k // 4) % 3 + rng.uniform(0.1, 0.9)) / 3)
        # Evenly in the inverse distance: near views are worth more and are easier to hold.
        z = 1.0 / rng.uniform(1 / far, 1 / near)
        turn = np.deg2rad(np.array(tilts[(k * 2 + k // 5) % 5]) + rng.normal(0, 7, 2))
        roll = float(np.clip(rng.normal(0, 8), -20, 20))
        vector = np.array([-turn[1], turn[0], np.deg2rad(roll)])
        rotation = np.asarray(cv2.Rodrigues(vector)[0], float)
        size = np.array([rig.depth.width, rig.depth.height])
        share = 0.5 + (np.array(place) - 0.5) * (1.0 - 0.004 * tries % 0.5)
        ray = rig.depth.rays((share * size)[None])[0]
        pose = RigidTransform(rotation, ray * z - rotation @ spec.centre_m)
        corners = pose.apply(spec.corners_m)
        if corners[:, 2].min() < 0.5 * near:
            continue
        seen = rig.depth.contains(rig.depth.project(corners), 6.0)
        other = rig.picture_camera.contains(rig.project_to_picture(corners), 6.0)
        if (seen & other).mean() > 0.93:
            poses.append(pose)
    return poses
