"""From captures to records: distances between joints and to lesions, relocation from the first capture."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from core.anchors import JOINT_NAMES, AnalysedCapture, SkeletonTracker
from core.capture.folder import CAPTURE_FILE
from core.errors import WorkError
from core.evaluation.thesis.clicks import CLICKS_FILE
from core.evaluation.thesis.frames import SurfaceKind, analyse_frame
from core.evaluation.thesis.records import CaptureRecord, read_record, write_record
from core.evaluation.thesis.sequences import StanceSequence, check_first_clicked, read_clicked
from core.progress import Progress, no_progress
from core.relocation import LesionQuery, MethodContext, RelocationOptions, relocation_method
from core.relocation.clock import PhaseClock
from core.relocation.field_store import FIELDS, GeodesicKind, nearest_corner
from core.relocation.pair import PickedLesion, VisitPair, anchor_points
from core.surface import pick_skin

FloatArray = NDArray[np.float64]

KINDS: Final[dict[str, GeodesicKind]] = {"DM": "grid-dijkstra", "FMM": "delaunay-fast-marching"}
"""The thesis's two geodesics by its names."""

VOTING: Final[dict[str, str]] = {"DM": "voting-dijkstra", "FMM": "voting-fmm"}
"""The relocation on each."""


@dataclass(frozen=True)
class Protocol:
    """How the captures of every stance are judged.

    Attributes
    ----------
    surface : {"raw", "smoothed"}
    beside : tuple of str
        Relocation methods measured beside the thesis's two.
    options : RelocationOptions
        The band of the votes.
    seed : int
        Of the methods' random draws.
    """

    surface: SurfaceKind = "raw"
    beside: tuple[str, ...] = ("trilateration",)
    options: RelocationOptions = field(default_factory=lambda: RelocationOptions(check_visibility=False))
    seed: int = 0

    @property
    def methods(self) -> tuple[str, ...]:
        """The thesis's methods first."""
        return tuple(dict.fromkeys((*VOTING.values(), *self.beside)))


def measure_stance(
    sequence: StanceSequence,
    tracker: SkeletonTracker,
    protocol: Protocol,
    *,
    keep: Path | None = None,
    progress: Progress = no_progress,
) -> list[CaptureRecord]:
    """Records of all captures of a stance, in order.

    Parameters
    ----------
    keep : Path, optional
        Folder in which records are kept, so that a stopped run goes on where it was.

    Raises
    ------
    WorkError
        If the first capture, the reference of all others, shows no usable body.
    Cancelled
        Through ``progress``; what was measured until then is kept.
    """
    reference: AnalysedCapture | None = None
    lesions: list[PickedLesion] = []
    records = []
    base = _fingerprint(sequence.folders[0], json.dumps([repr(protocol)]))
    for number, folder in enumerate(sequence.folders):
        progress(number / len(sequence.folders), f"{sequence.name}, capture {folder.name}")
        made_of = _fingerprint(folder, base)
        path = None if keep is None else keep / sequence.name / f"{folder.name}.json"
        kept = None if path is None else read_record(path, made_of)
        if kept is not None:
            records.append(kept)
            continue
        if reference is None and number > 0:
            reference, lesions = _reference(sequence, tracker, protocol)
        clicked = read_clicked(folder)
        if number == 0:
            check_first_clicked(sequence, clicked)
        try:
            analysed = analyse_frame(clicked, tracker, protocol.surface)
        except WorkError as error:
            if number == 0:
                raise WorkError(
                    f"{folder}: {error.message}", "The first capture is the reference."
                ) from error
            record = CaptureRecord(clicked.name, unusable=error.message)
        else:
            picked = pick_lesions(analysed, clicked.clicks.lesions)
            if number == 0:
                reference, lesions = analysed, picked
            assert reference is not None
            answers, seconds = ({}, {}) if number == 0 else _relocate(reference, analysed, lesions, protocol)
            record = _record(clicked.name, analysed, picked, answers, seconds)
        if path is not None:
            write_record(path, record, made_of)
        records.append(record)
    progress(1.0, sequence.name)
    return records


def _reference(
    sequence: StanceSequence, tracker: SkeletonTracker, protocol: Protocol
) -> tuple[AnalysedCapture, list[PickedLesion]]:
    first = read_clicked(sequence.folders[0])
    analysed = analyse_frame(first, tracker, protocol.surface)
    return analysed, pick_lesions(analysed, first.clicks.lesions)


def pick_lesions(analysed: AnalysedCapture, clicks: Mapping[str, tuple[float, float]]) -> list[PickedLesion]:
    """Clicked lesions on the skin; a click that misses it (or falls on hair) is left out."""
    head = analysed.skeleton.joints.get("head")
    out = []
    for name, pixel in clicks.items():
        pick = pick_skin(analysed.scan, pixel, head_m=None if head is None else head.point_m)
        if pick.point is not None and pick.normal is not None:
            out.append(PickedLesion(LesionQuery(name, pixel), pick.point, pick.normal))
    return out


def _relocate(
    first: AnalysedCapture, followup: AnalysedCapture, lesions: Sequence[PickedLesion], protocol: Protocol
) -> tuple[dict[str, dict[str, list[float] | None]], dict[str, float]]:
    """Answers and CPU seconds of every method. As in the thesis, no lesion is refused."""
    pair = VisitPair(first, followup)
    answers: dict[str, dict[str, list[float] | None]] = {}
    seconds: dict[str, float] = {}
    if not lesions:
        return answers, seconds
    for name in protocol.methods:
        context = MethodContext(
            protocol.options,
            appearance=False,
            seed=protocol.seed,
            clock=PhaseClock(),
            progress=no_progress,
        )
        start = time.process_time()
        outcome = relocation_method(name).estimate(pair, lesions, context)
        seconds[name] = time.process_time() - start
        answers[name] = {
            lesion.query.id: None if e.point_m is None else [float(x) for x in e.point_m]
            for lesion, e in zip(lesions, outcome.estimates, strict=True)
        }
    return answers, seconds


def _record(
    name: str,
    analysed: AnalysedCapture,
    lesions: Sequence[PickedLesion],
    answers: dict[str, dict[str, list[float] | None]],
    seconds: dict[str, float],
) -> CaptureRecord:
    surface = analysed.scan.surface
    joints = tuple(a.name for a in analysed.anchors.anchors if a.reliable)
    rows = [JOINT_NAMES.index(joint) for joint in joints]
    corners = [nearest_corner(surface, analysed.anchors[joint].point) for joint in joints]
    ends = [nearest_corner(surface, lesion.point) for lesion in lesions]
    between: dict[str, list[list[float]]] = {}
    to_lesion: dict[str, dict[str, list[float]]] = {}
    for label, kind in KINDS.items():
        fields = FIELDS.fields(surface, anchor_points(analysed, joints), kind)
        square = np.full((len(JOINT_NAMES), len(JOINT_NAMES)), np.nan)
        if joints:
            both_ways = fields.distances[:, corners]
            mean = 0.5 * (both_ways + both_ways.T)
            square[np.ix_(rows, rows)] = np.where(np.isfinite(mean), mean, np.nan)
        between[label] = square.tolist()
        to_lesion[label] = {}
        for lesion, end in zip(lesions, ends, strict=True):
            column = np.full(len(JOINT_NAMES), np.nan)
            column[rows] = np.where(np.isfinite(fields.distances[:, end]), fields.distances[:, end], np.nan)
            to_lesion[label][lesion.query.id] = column.tolist()
    return CaptureRecord(
        name,
        vertices=len(surface.vertices),
        joints_m={joint: analysed.anchors[joint].position_m.tolist() for joint in joints},
        lesions_m={p.query.id: np.asarray(p.point.position_m).tolist() for p in lesions},
        between_m=between,
        to_lesion_m=to_lesion,
        answers_m=answers,
        cpu_seconds=seconds,
    )


def _fingerprint(folder: Path, before: str) -> str:
    """What a record depends on: the capture's description and clicks, and everything in ``before``."""
    digest = hashlib.sha256(before.encode())
    for name in (CAPTURE_FILE, CLICKS_FILE):
        path = folder / name
        if path.exists():
            digest.update(path.read_bytes())
    for path in sorted(folder.glob("*.png")):
        stat = path.stat()
        digest.update(f"{path.name} {stat.st_size} {stat.st_mtime_ns}".encode())
    return digest.hexdigest()
