"""What ``geoderm hand train`` and ``geoderm hand track`` print: one document, as JSON or as short tables."""

from __future__ import annotations

import sys
from collections import Counter
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from core.hand.learning import Lesson
    from core.hand.tracks import Tracks

_MOST_LINES = 20
_UNKNOWN = "unknown"
_CORNER = "true \\ said"


class Ticker:
    """Progress on the line of a terminal; silent where standard error is none."""

    def __init__(self) -> None:
        self._shown = sys.stderr.isatty()

    def __call__(self, fraction: float, message: str = "") -> None:
        """Show what is being done; an empty message clears the line."""
        if self._shown:
            sys.stderr.write(f"\r\033[K{f'{100 * fraction:3.0f} % {message[:70]}' if fraction < 1 else ''}")
            sys.stderr.flush()


def lesson_document(lesson: Lesson, out: Path, unlabelled: int, seconds: float) -> dict[str, Any]:
    """A lesson as a JSON object."""
    confusion = lesson.confusion
    return {
        "model": str(out),
        "anchors": lesson.model.anchors,
        "marker_m": lesson.model.marker_m,
        "dictionary": lesson.model.dictionary,
        "configurations": [{"name": name, "frames": n} for name, n in lesson.used.items()],
        "unlabelled": unlabelled,
        "left_out": [{"capture": name, "reason": reason} for name, reason in lesson.left_out],
        "points_left_out": [{"capture": name, "reason": reason} for name, reason in lesson.points_left_out],
        "confusion": None
        if confusion is None
        else {
            "classes": list(confusion.classes),
            "said": [*confusion.classes, _UNKNOWN],
            "counts": confusion.counts.tolist(),
            "folds": confusion.folds,
        },
        "accuracy": None if lesson.accuracy is None else round(lesson.accuracy, 4),
        "remarks": list(lesson.remarks),
        "seconds": round(seconds, 3),
    }


def lesson_lines(told: dict[str, Any]) -> list[str]:
    """The same for people."""
    width = max(len("configuration"), *(len(one["name"]) for one in told["configurations"]))
    lines = [f"{'configuration':{width}}  frames"]
    lines += [f"{one['name']:{width}}  {one['frames']:6d}" for one in told["configurations"]]
    if told["unlabelled"]:
        lines.append(f"{told['unlabelled']} captures without labels were not used.")
    for key, title in (("left_out", "Frames left out"), ("points_left_out", "Said of frames that were used")):
        lines += _listed(title, [f"{one['capture']}: {one['reason']}" for one in told[key]])
    if told["confusion"] is not None:
        lines += _confusion_lines(told["confusion"], told["accuracy"])
    lines += [f"note: {remark}" for remark in told["remarks"]]
    lines.append(f"Learned in {told['seconds']:.1f} s: {told['model']}")
    return lines


def _listed(title: str, entries: list[str]) -> list[str]:
    if not entries:
        return []
    lines = [f"{title} ({len(entries)}):", *(f"  {entry}" for entry in entries[:_MOST_LINES])]
    if len(entries) > _MOST_LINES:
        lines.append(f"  and {len(entries) - _MOST_LINES} more (--json tells all)")
    return lines


def _confusion_lines(confusion: dict[str, Any], accuracy: float) -> list[str]:
    classes, counts = confusion["classes"], confusion["counts"]
    total = sum(map(sum, counts))
    right = sum(counts[k][k] for k in range(len(classes)))
    width = max(12, *(len(name) for name in classes))
    told = confusion["said"]
    columns = [max(6, len(name)) for name in told]
    lines = [
        f"Cross-validation in {confusion['folds']} parts: {right} of {total} frames judged rightly "
        f"({100 * accuracy:.1f} %)",
        f"  {_CORNER:{width}}  " + "  ".join(f"{n:>{w}}" for n, w in zip(told, columns, strict=True)),
    ]
    for name, row in zip(classes, counts, strict=True):
        cells = "  ".join(f"{count:>{w}d}" for count, w in zip(row, columns, strict=True))
        lines.append(f"  {name:{width}}  {cells}")
    return lines


def tracks_document(tracks: Tracks, out: Path, times_s: list[float]) -> dict[str, Any]:
    """A summary of tracks as a JSON object.

    The rate leaves out the first frame, in which libraries load and the hand is looked for everywhere.
    """
    later_s = sum(times_s[1:])
    frames = tracks.frames
    found = [[p for p in frame.points.values() if p is not None] for frame in frames]
    confidences = [point.confidence for points in found for point in points]
    named = Counter(frame.configuration for frame in frames)
    reasons = Counter(frame.reason for frame in frames if frame.reason)
    return {
        "tracks": str(out),
        "frames": len(frames),
        "marker_seen": sum(frame.marker_seen for frame in frames),
        "frames_with_points": sum(bool(points) for points in found),
        "points": len(confidences),
        "configurations": [
            {"name": name, "frames": n, "share": round(n / len(frames), 4)} for name, n in named.most_common()
        ],
        "median_confidence": round(median(confidences), 4) if confidences else None,
        "frames_per_second": round((len(frames) - 1) / later_s, 2) if later_s > 0 else None,
        "reasons": [{"reason": reason, "frames": n} for reason, n in reasons.most_common()],
    }


def tracks_lines(told: dict[str, Any]) -> list[str]:
    """The same for people."""
    frames = told["frames"]
    lines = [
        f"{frames} frames, {told['marker_seen']} with the anchors in view, "
        f"{told['frames_with_points']} with points"
    ]
    for one in told["configurations"]:
        name = _UNKNOWN if one["name"] is None else one["name"]
        lines.append(f"  {name}: {one['frames']} frames ({100 * one['share']:.1f} %)")
    if told["median_confidence"] is None:
        lines.append("No point was found.")
    else:
        lines.append(
            f"{told['points']} of {15 * frames} points told, "
            f"median confidence {told['median_confidence']:.2f}"
        )
    lines += _listed("Said of frames", [f"{one['reason']} ({one['frames']})" for one in told["reasons"]])
    rate = told["frames_per_second"]
    speed = "" if rate is None else f"{rate:.1f} frames/s after the first, without reading files. "
    lines.append(f"{speed}Written: {told['tracks']}")
    return lines
