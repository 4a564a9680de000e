"""The figures of the hand experiments as Markdown."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

Figures = Mapping[str, Any]

_ACCURACY = (
    "frames", "no answer", "outliers", "joint-joint", "all pairs", "over time (sd)", "along the skin",
    "point", "point P90", "visible told", "hidden told", "hidden error", "configuration",
)  # fmt: skip


def markdown(document: Figures) -> str:
    """The whole report."""
    parts = ["# The hand tracker on simulated hands", _about(document["about"])]
    if "training" in document:
        parts.append(_training(document["training"]))
    sections = {
        "classifier": _classifier,
        "large": _large,
        "occlusion": _occlusion,
        "bottle": _bottle,
        "lost": _lost,
        "palm": _palm,
    }
    parts += [draw(document[key]) for key, draw in sections.items() if key in document]
    if "real" in document:
        parts.append(_real(document["real"]))
    return "\n\n".join(parts) + "\n"


def table(columns: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """A Markdown table."""
    lines = ["| " + " | ".join(columns) + " |", "|" + "---|" * len(columns)]
    lines += ["| " + " | ".join(str(cell) for cell in row) + " |" for row in rows]
    return "\n".join(lines)


def spread_words(spread: Figures) -> str:
    """A figure with its interval over hands, or with those of the hands if they are few."""
    value, low, high = spread["value"], spread["low"], spread["high"]
    if not np.isfinite(value):
        return "-"
    if np.isfinite(low):
        return f"{value:.1f} ({low:.1f}-{high:.1f})"
    bodies = spread["by_body"].values()
    return f"{value:.1f} [{', '.join(f'{v:.1f}' for v in bodies)}]" if len(bodies) > 1 else f"{value:.1f}"


def accuracy_row(figures: Figures) -> list[str]:
    """One row of the columns of accuracy."""
    return [
        str(figures["frames"]),
        str(figures["unanswered"]),
        str(figures["outliers"]),
        *(spread_words(figures[f"{key}_mm"]) for key in ("joint", "joint_pairs", "joint_sd", "path")),
        spread_words(figures["point_mm"]),
        spread_words(figures["point_p90_mm"]),
        _share(figures["visible_told"], figures["visible"]),
        _share(figures["hidden_told"], figures["hidden"]),
        spread_words(figures["hidden_mm"]),
        f"{figures['right']}/{figures['judged']}" if figures["judged"] else "-",
    ]


def accuracy_table(first: str, rows: Mapping[str, Figures]) -> str:
    """A table of accuracies; millimetres."""
    return table((first, *_ACCURACY), ([name, *accuracy_row(row)] for name, row in rows.items()))


def confusion_table(judged: Figures) -> str:
    """What was said (columns) of what was shown (rows)."""
    rows = ([f"**{name}**", *row] for name, row in zip(judged["classes"], judged["counts"], strict=True))
    return table(("shown", *judged["columns"]), rows)


def judged_words(judged: Figures) -> str:
    """The figures of a classifier in a sentence."""
    counts = np.array(judged["counts"])
    value, low, high = judged["percent"]
    interval = f", 95 % interval over hands {low:.1f}-{high:.1f}" if np.isfinite(low) else ""
    return (
        f"{judged['right']} of {judged['frames']} right ({value:.1f} %{interval}), {judged['wrong']} wrong, "
        f"{counts[:, -2].sum()} said to be unknown, {counts[:, -1].sum()} without an answer; "
        f"{judged['forced_right']} if the likeliest were always said."
    )


def speed_words(speed: Figures) -> str:
    """Frames per second and where the time goes."""
    if not speed:
        return ""
    steps = ", ".join(f"{step} {ms:.0f}" for step, ms in speed["by_step_ms"].items())
    return (
        f"{speed['frames_per_s']:.1f} frames/s by the clock at a load of {speed['load']} on 2 cores "
        f"({speed['wall_ms']['median']:.0f} ms, P90 {speed['wall_ms']['p90']:.0f}), processor time "
        f"{speed['cpu_ms']['median']:.0f} ms (P90 {speed['cpu_ms']['p90']:.0f}), that is "
        f"{speed['frames_per_cpu_s']:.1f} frames for a second of one core. By step, ms: {steps}."
    )


def _share(part: int, whole: int) -> str:
    return f"{part}/{whole} ({100 * part / whole:.0f} %)" if whole else "-"


def _about(about: Figures) -> str:
    lines = ["Millimetres. In brackets: 95 % interval over hands (bootstrap), or every hand's own figure."]
    for key, value in about.items():
        words = (
            "; ".join(f"{k}: {v}" for k, v in value.items())
            if isinstance(value, Mapping)
            else ", ".join(value) if isinstance(value, list) else value
        )  # fmt: skip
        lines.append(f"* {key}: {words}")
    return "\n".join(lines)


def _training(training: Figures) -> str:
    frames = ", ".join(f"{name} {count}" for name, count in training["frames"].items())
    left = training["left_out"]
    reasons: dict[str, int] = {}
    for _, reason in left:
        reasons[reason] = reasons.get(reason, 0) + 1
    said = "; ".join(f"{reason} ({count})" for reason, count in reasons.items())
    more = f": {said}" if said else ""
    return f"Learned from {training['hands']} hands: {frames}. Left out: {len(left)}{more}."


def _classifier(figures: Figures) -> str:
    parts = ["## Configurations, single frames of hands never learned from"]
    for key in ("three", "five", "six", "few"):
        one = figures[key]
        hardest = " (harder: a gripping hand looks much like a fist and a pinch)" if key == "six" else ""
        parts += [
            f"### {one['title']}{hardest}\n\n{one['training']} training frames (cross-validated on them, "
            f"by hands: {one['cross_validated'][0]} of {one['cross_validated'][1]}). "
            f"{judged_words(one)}",
            confusion_table(one),
        ]
        faults = one["faults"][:12]
        if faults:
            parts.append("\n".join(f"* {name}: {said}. {why}" for name, said, why in faults))
    parts.append("### Points of these frames")
    rows = {figures[key]["title"]: figures[key]["accuracy"] for key in ("three", "five", "six", "few")}
    parts.append(accuracy_table("classifier", rows))
    parts.append(
        "### A configuration that was not learned\n\n"
        + table(
            ("shown", "frames", "said to be unknown", "taken for"),
            (
                (
                    m["name"],
                    m["frames"],
                    _share(m["unknown"], m["frames"]),
                    ", ".join(f"{k} {v}" for k, v in m["taken_for"].items()) or "-",
                )
                for m in figures["unlearned"]
            ),
        )
    )
    changing = figures["changing"]
    parts.append(
        "### Within sequences, one configuration after the other (frames between two do not count)\n\n"
        f"{judged_words(changing)}\n\n{confusion_table(changing)}\n\n{speed_words(changing['speed'])}"
    )
    return "\n\n".join(parts)


def _large(figures: Figures) -> str:
    names = {
        "joint": "all points solved together",
        "sequential": "the thesis's eq. 7, point after point",
        "own": "model of the hand itself, of at most 5 frames per configuration",
    }
    parts = [
        "## Large displacements\n\nAn outlier is a frame whose median joint-joint error is above 15 mm.",
        accuracy_table("refinement", {names[key]: one["all"] for key, one in figures.items()}),
    ]
    for key, one in figures.items():
        parts += [
            f"### {names[key]}\n\n{speed_words(one['speed'])}",
            accuracy_table("hand", one["by_body"]),
            accuracy_table("anchors", one["by_anchors"]),
        ]
    return "\n\n".join(parts)


def _occlusion(figures: Figures) -> str:
    rows = {
        f"{threshold}, {word}": one[key]
        for threshold, one in figures.items()
        for key, word in (("passing", "something passes"), ("free", "nothing before the hand"))
    }
    return (
        "## Occlusions\n\nBy error threshold, beyond which a point is not told. A hidden point that is told "
        "is wrong to be told, however near it is.\n\n" + accuracy_table("threshold", rows)
    )


def _bottle(figures: Figures) -> str:
    return (
        "## A bottle\n\nModel of six configurations; the hand goes from open to grip and back.\n\n"
        + accuracy_table("frames", {"all": figures["all"], "holding the bottle": figures["holding"]})
        + f"\n\n{judged_words(figures['judged'])}\n\n{confusion_table(figures['judged'])}"
    )


def _lost(figures: Figures) -> str:
    rows = {{"0": "seen", "beyond": "more than 10"}.get(since, since): one for since, one in figures.items()}
    return "## Marker lost\n\nBy frames since it was seen.\n\n" + accuracy_table("frames since", rows)


def _palm(figures: Figures) -> str:
    stills, large = figures["stills"], figures["large"]
    rows = {
        "marker, stills": stills["marker"],
        "palm, stills": stills["palm"],
        "marker, large displacements": large["marker"],
        "palm, large displacements": large["palm"],
    }
    said = "ours, landmarks, their points, frames, ours told, ours, ours P90, theirs told, theirs, theirs P90"
    columns = (*said.split(", "), "both", "ours, both", "P90", "theirs, both", "P90", "ours nearer, %")
    keys = ("both_ours_mm", "both_ours_p90_mm", "both_theirs_mm", "both_theirs_p90_mm", "nearer")
    beside = (
        [
            b["ours"],
            b["way"],
            b["points"],
            b["frames"],
            _share(b["ours_told"], b["visible"]),
            spread_words(b["ours_mm"]),
            spread_words(b["ours_p90_mm"]),
            _share(b["theirs_told"], b["visible"]),
            spread_words(b["theirs_mm"]),
            spread_words(b["theirs_p90_mm"]),
            b["both"],
            *(spread_words(b[key]) for key in keys),
        ]
        for b in figures["beside_landmarks"]
    )
    return "\n\n".join(
        [
            "## Without a marker: the palm's landmarks as anchors, on the same hands and views",
            _training(figures["training"]),
            accuracy_table("anchors", rows),
            speed_words(figures["speed"]),
            "## Beside MediaPipe Hands lifted by depth (visible points, distance to the truth)",
            table(columns, beside),
        ]
    )


def _real(rows: Sequence[Figures]) -> str:
    return "## Depth pictures of a real hand: segmentation and surface alone\n\n" + table(
        ("picture", "distance, m", "vertices", "triangles", "area, cm2", "largest part, %", "fault"),
        (
            (
                row["name"],
                f"{row['distance_m']:.2f}",
                row["vertices"],
                row["triangles"],
                f"{row['area_cm2']:.0f}",
                f"{100 * row['largest_part']:.0f}",
                row["fault"] or "",
            )
            for row in rows
        ),
    )
