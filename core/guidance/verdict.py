"""The verdict of a finished capture: refused, usable or good, why, and a picture of what is missing."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from core.anchors import JOINT_NAMES, AnalysedCapture, Skeleton
from core.capture.rgbd import RgbdCapture
from core.guidance.faults import FAULTS, Fault, cut_off, draw, fault_size, label_of, unmeasured
from core.guidance.framing import Reach
from core.guidance.light import DARK, burnt, luminance
from core.guidance.moment import COARSE_WIDTH
from core.guidance.sharpness import edge_blur
from core.guidance.stillness import burst_motion_mm
from core.surface import BodyScan, scan_body

BoolArray = NDArray[np.bool_]

Grade = Literal["good", "usable", "refused"]

COVERED: Final = 0.97
LEAST_COVERED: Final = 0.5
"""Share of the body with depth: below the first a doubt, below the second no basis for measuring."""

MOVED_MM: Final = 12.0
TOO_FAR_MOVED_MM: Final = 40.0
"""Movement within the burst: fused depth loses detail from the first on, and its shape from the second."""

BLURRED_PX: Final = 1.6
USELESS_BLUR_PX: Final = 6.0
BURNT_SHARE: Final = 0.02
LEAST_JOINTS: Final = 5
FEW_JOINTS: Final = 12
BLACK: Final = 12.0
UNCOVERED_PHOTO: Final = 0.03

_SHARP_WIDTH: Final = 1280
_CELLS: Final = (5, 3)
_ORDER: Final[tuple[Grade, ...]] = ("good", "usable", "refused")


@dataclass(frozen=True)
class Finding:
    """One thing that is less than it should be.

    Attributes
    ----------
    name : str
        "coverage", "cut", "photo", "blur", "light", "motion", "distance" or "joints".
    grade : {"usable", "refused"}
    value : float
        What was measured; its unit is in the sentence.
    sentence : str
        What is wrong and what to do.
    """

    name: str
    grade: Grade
    value: float
    sentence: str


@dataclass(frozen=True, eq=False)
class CaptureQuality:
    """Verdict of a capture.

    Attributes
    ----------
    grade : {"good", "usable", "refused"}
        The worst of the findings.
    findings : tuple of Finding
        Worst first; empty for a good capture.
    faults : ndarray (h, w) uint8
        The photo's shape, small: 0, or 1 + the index in `faults.FAULTS` of what is wrong there.
    measures : dict of str to float
        All that was measured: coverage (0..1), motion_mm, blur_px, light (0..255), distance_m, joints.
    """

    grade: Grade
    findings: tuple[Finding, ...]
    faults: NDArray[np.uint8]
    measures: dict[str, float] = field(default_factory=dict)

    @property
    def sentences(self) -> tuple[str, ...]:
        """What to tell the user, worst first."""
        return tuple(finding.sentence for finding in self.findings)

    @property
    def shown_faults(self) -> tuple[Fault, ...]:
        """Faults that the picture shows."""
        return tuple(fault for fault in FAULTS if (self.faults == label_of(fault)).any())


def judge_capture(capture: RgbdCapture | AnalysedCapture, *, whole_body: bool = True) -> CaptureQuality:
    """Judge whether a capture is good enough to be measured in.

    Parameters
    ----------
    capture : RgbdCapture or AnalysedCapture
        Of a plain capture the body is looked for first; its joints are not judged.
    whole_body : bool
        False: the feet need not be in the picture.

    Raises
    ------
    WorkError
        If there is no body in a plain capture.
    """
    if isinstance(capture, AnalysedCapture):
        scan, skeleton = capture.scan, capture.skeleton
    else:
        scan, skeleton = scan_body(capture), None
    findings: list[Finding] = []
    measures: dict[str, float] = {}
    faults = np.zeros(fault_size(scan.capture), np.uint8)
    _judge_depth(scan, skeleton, whole_body, findings, measures, faults)
    _judge_motion(scan, findings, measures)
    _judge_photo(scan, findings, measures, faults)
    if skeleton is not None:
        _judge_joints(skeleton, findings, measures)
    findings.sort(key=lambda finding: -_ORDER.index(finding.grade))
    return CaptureQuality(findings[0].grade if findings else "good", tuple(findings), faults, measures)


def _judge_depth(
    scan: BodyScan,
    skeleton: Skeleton | None,
    whole_body: bool,
    findings: list[Finding],
    measures: dict[str, float],
    faults: NDArray[np.uint8],
) -> None:
    mask, depth = scan.mask.mask, scan.fused.depth_m
    body = np.where(mask, depth, 0.0)
    distance = float(np.median(depth[mask]))
    pixels_per_m = scan.capture.rig.depth.fx / distance
    missing = unmeasured(mask, depth, pixels_per_m, scan.capture, skeleton)
    covered = float(mask.sum() / (mask.sum() + missing.sum()))
    measures["coverage"], measures["distance_m"] = covered, distance
    draw(faults, "no depth", missing, body, scan.capture)
    if covered < COVERED:
        grade: Grade = "refused" if covered < LEAST_COVERED else "usable"
        findings.append(
            Finding(
                "coverage",
                grade,
                covered,
                f"{1 - covered:.0%} of the body has no depth: uncover dark or shiny cloth, avoid sunlight.",
            )
        )
    sides, strip = cut_off(mask, depth, pixels_per_m)
    sides = [side for side in sides if whole_body or side != "bottom"]
    if sides:
        draw(faults, "outside", strip, body, scan.capture)
        said = {"top": "above", "bottom": "below", "left": "at the left edge", "right": "at the right edge"}
        where = " and ".join(said[side] for side in sides)
        findings.append(
            Finding("cut", "usable", float(len(sides)), f"The body is cut off {where}: step back if you can.")
        )
    reach = Reach.of_sensor(scan.capture.sensor)
    if distance > reach.far_m:
        say = f"The patient stood {distance:.1f} m away, where depth is uncertain: come closer."
        findings.append(Finding("distance", "usable", distance, say))


def _judge_motion(scan: BodyScan, findings: list[Finding], measures: dict[str, float]) -> None:
    frames, mask = scan.capture.depth_frames, scan.mask.mask
    step = max(1, mask.shape[1] // COARSE_WIDTH)
    coarse = np.s_[step // 2 :: step, step // 2 :: step]
    moved = burst_motion_mm(
        frames[:, *coarse],
        scan.capture.depth_unit_m,
        mask[coarse],
        scan.capture.rig.depth.fx / step / measures["distance_m"],
    )
    if moved is None:
        return
    measures["motion_mm"] = moved
    if moved > MOVED_MM:
        grade: Grade = "refused" if moved > TOO_FAR_MOVED_MM else "usable"
        say = f"The patient moved by {moved:.0f} mm while the frames were taken: ask to hold still."
        findings.append(Finding("motion", grade, moved, say))


def _judge_photo(
    scan: BodyScan, findings: list[Finding], measures: dict[str, float], faults: NDArray[np.uint8]
) -> None:
    photo = scan.capture.color
    if photo is None:
        return
    inside = scan.capture.rig.picture_camera.contains(scan.vertex_picture_pixels)
    outside = 1.0 - float(inside.mean())
    if outside > UNCOVERED_PHOTO:
        say = f"{outside:.0%} of the measured skin lies outside of the photo: aim the colour camera."
        findings.append(Finding("photo", "usable", outside, say))
    height, width = faults.shape
    small = np.asarray(cv2.resize(photo, (width, height), interpolation=cv2.INTER_AREA), np.uint8)
    on = _body_in_photo(scan, faults.shape)
    if not on.any():
        return
    level = float(np.percentile(luminance(small[on]), 75))
    measures["light"] = level
    if level < DARK:
        grade: Grade = "refused" if level < BLACK else "usable"
        findings.append(Finding("light", grade, level, "The photo is too dark: switch on more light."))
    white = burnt(small) & on
    share = float(white.sum() / on.sum())
    if share > BURNT_SHARE:
        grown = cv2.dilate(white.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
        faults[grown & on] = label_of("over-exposed")
        say = f"{share:.0%} of the skin is over-exposed: dim or move the lamp."
        findings.append(Finding("light", "usable", share, say))
    _judge_blur(photo, on, findings, measures, faults)


def _body_in_photo(scan: BodyScan, shape: tuple[int, int]) -> BoolArray:
    share = shape[1] / scan.capture.rig.picture_camera.width
    at = np.rint((scan.vertex_picture_pixels + 0.5) * share - 0.5)
    at = at[np.isfinite(at).all(1)].astype(int)
    ok = (at >= 0).all(1) & (at[:, 0] < shape[1]) & (at[:, 1] < shape[0])
    hit = np.zeros(shape, np.uint8)
    hit[at[ok, 1], at[ok, 0]] = 1
    return np.asarray(cv2.morphologyEx(hit, cv2.MORPH_CLOSE, np.ones((5, 5), np.uint8))) > 0


def _judge_blur(
    photo: NDArray[np.uint8],
    on: BoolArray,
    findings: list[Finding],
    measures: dict[str, float],
    faults: NDArray[np.uint8],
) -> None:
    """Blur of the whole body and, where it is blurred in parts, of these."""
    share = min(1.0, _SHARP_WIDTH / photo.shape[1])
    size = (round(photo.shape[1] * share), round(photo.shape[0] * share))
    picture = photo if share == 1.0 else np.asarray(cv2.resize(photo, size, interpolation=cv2.INTER_AREA))
    grey = np.asarray(cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY), np.uint8)
    around = cv2.dilate(on.astype(np.uint8), np.ones((5, 5), np.uint8))
    wide = np.asarray(cv2.resize(around, size, interpolation=cv2.INTER_NEAREST)) > 0
    whole = edge_blur(grey, wide)
    if whole is None:
        return
    worst = max(whole)
    measures["blur_px"] = worst
    rows, columns = np.flatnonzero(on.any(axis=1)), np.flatnonzero(on.any(axis=0))
    scale = size[0] / on.shape[1]
    blurred = 0
    cells = 0
    for ys in np.array_split(rows, _CELLS[0]):
        for xs in np.array_split(columns, _CELLS[1]):
            if not len(ys) or not len(xs):
                continue
            box = np.s_[
                int(ys[0] * scale) : int(ys[-1] * scale) + 1, int(xs[0] * scale) : int(xs[-1] * scale) + 1
            ]
            found = edge_blur(grey[box], wide[box])
            if found is None:
                continue
            cells += 1
            if max(found) > BLURRED_PX:
                blurred += 1
                there = faults[ys[0] : ys[-1] + 1, xs[0] : xs[-1] + 1]
                there[on[ys[0] : ys[-1] + 1, xs[0] : xs[-1] + 1] & (there == 0)] = label_of("blurred")
    if worst > BLURRED_PX or (cells and blurred > cells // 3):
        grade: Grade = "refused" if worst > USELESS_BLUR_PX else "usable"
        say = "The photo is blurred: hold still, give more light, check the focus."
        findings.append(Finding("blur", grade, worst, say))
    else:
        faults[faults == label_of("blurred")] = 0


def _judge_joints(skeleton: Skeleton, findings: list[Finding], measures: dict[str, float]) -> None:
    seen = len(skeleton.visible())
    measures["joints"] = float(seen)
    if seen < FEW_JOINTS:
        grade: Grade = "refused" if seen < LEAST_JOINTS else "usable"
        say = f"Only {seen} of {len(JOINT_NAMES)} joints were found: the whole body should be in the picture."
        findings.append(Finding("joints", grade, float(seen), say))
