"""results.json and report.md: all numbers, and the page a person reads."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from core.errors import WorkError
from core.evaluation.thesis.experiments import ThesisResults
from core.evaluation.thesis.records import without_nan
from core.evaluation.thesis.statistics import GOOD
from core.relocation import write_json

SIMULATED = (
    "**The captures are simulated.** Bodies are linear-blend skinned, moles are clean dark discs, the noise "
    "is a model of a Kinect. The figures order methods; they are no accuracy on people."
)
RECORDED = "The captures are recordings; the truth is what a person clicked in their `clicks.json`."


def write_results(results: ThesisResults, out: Path) -> tuple[Path, Path]:
    """Write results.json and report.md into ``out``."""
    numbers, page = out / "results.json", out / "report.md"
    write_json(numbers, without_nan({**results.numbers, "notes": results.notes}))
    partial = page.with_name(f".{page.name}.part")
    try:
        partial.write_text(report_text(results, out), encoding="utf-8")
        partial.replace(page)
    except OSError as error:
        raise WorkError(f"{page}: cannot be written ({error.strerror or error}).") from error
    return numbers, page


def report_text(results: ThesisResults, out: Path) -> str:
    """The report in Markdown; pictures are named relative to ``out``."""
    n = results.numbers
    stances = ", ".join(f"{name} ({count})" for name, count in n["stances"].items()) or "none"
    parts = [
        "# The thesis's experiments",
        SIMULATED if n["source"] == "simulated" else RECORDED,
        f"Captures by stance: {stances}. One depth frame each, {n['protocol']['surface']} depth; half width "
        f"of a voting band {1000 * n['protocol']['options']['delta_m']:.0f} mm.",
    ]
    for title, section in (
        ("Table 2: mean error", _table_2),
        ("Figure 8: path lengths", _paths),
        ("Figure 9: grades of the joints", _grades),
        ("Figure 10: variance of joint-joint distances", _variances),
        ("CPU time", _cpu),
        ("Stances ranked by error", _ranking),
        ("Error against time", _error_time),
    ):
        text = section(n)
        if text:
            parts += [f"## {title}", text]
    if results.pictures:
        parts.append("## Pictures")
        parts += [f"{title}\n\n![{title}]({p.relative_to(out)})" for title, p in results.pictures.items()]
    if results.notes:
        parts += ["## Left out", "\n".join(f"* {note}" for note in results.notes)]
    return "\n\n".join(parts) + "\n"


def markdown_table(head: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    """A Markdown table."""
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    lines += ["| " + " | ".join(str(cell) for cell in row) + " |" for row in rows]
    return "\n".join(lines)


def _mm(value: float | None, digits: int = 1) -> str:
    return "-" if value is None or not math.isfinite(value) else f"{1000 * value:.{digits}f}"


def _table_2(n: Mapping[str, Any]) -> str:
    if "table_2" not in n:
        return ""
    head = ("stance", "method", "mean mm", "95 % interval", "median", "P95", "answers", "thesis: mean mm")
    rows = [
        (
            row["stance"],
            row["method"],
            _mm(row["mean_m"]),
            f"{_mm(row['low_m'])}-{_mm(row['high_m'])}",
            _mm(row["median_m"]),
            _mm(row["p95_m"]),
            f"{row['answered']} of {row['judged']} in {row['images']} images",
            "" if row["thesis_m"] is None else f"{_mm(row['thesis_m'], 0)} (pose {row['pose']})",
        )
        for row in n["table_2"]
    ]
    return (
        markdown_table(head, rows)
        + "\n\nThe thesis's poses are not these stances: its figures stand beside for the order of size only."
    )


def _paths(n: Mapping[str, Any]) -> str:
    if "figure_8" not in n:
        return ""
    rows = []
    for p in n["figure_8"]["paths"]:
        longer = [f"{100 * p[k]:+.1f} %" if k in p else "" for k in ("DM_longer", "FMM_longer")]
        rows.append(
            (
                p["surface"],
                p["path"],
                _mm(p.get("straight_m")),
                _mm(p["DM_m"]),
                longer[0],
                _mm(p["FMM_m"]),
                longer[1],
            )
        )
    head = ("surface", "path", "straight mm", "DM mm", "against straight", "FMM mm", "against straight")
    wall = n["figure_8"]["wall"]
    return markdown_table(head, rows) + (f"\n\nThe Kinect plane: {wall}." if wall else "")


def _grades(n: Mapping[str, Any]) -> str:
    if not n.get("figure_9"):
        return ""
    delta = 1000 * n["protocol"]["options"]["delta_m"]
    rule = (
        f"A joint votes rightly when |e| < {delta:.0f} mm, the half width of a voting band. *Good*: right in "
        f"at least {GOOD:.0%} of captures and lesions; *reasonable*: at least twice as often right as wrong; "
        "*bad*: less. Share of right votes, and 95 % of |e| in mm:"
    )
    stances = list(n["figure_9"])
    head = ("joint", *(f"{stance}, {label}" for stance in stances for label in ("FMM", "DM")))
    rows = []
    for joint in n["figure_9"][stances[0]]["FMM"]:
        cells = [n["figure_9"][stance][label][joint] for stance in stances for label in ("FMM", "DM")]
        rows.append(
            (
                joint.replace("_", " "),
                *(f"{c['grade']} ({c['right']:.0%}, {_mm(c['p95_m'], 0)})" for c in cells),
            )
        )
    return f"{rule}\n\n{markdown_table(head, rows)}"


def _variances(n: Mapping[str, Any]) -> str:
    if "figure_10" not in n:
        return ""
    rows = [
        (stance, label, m["pairs"], _cm2(m["mean_m2"]), _cm2(m["median_m2"]))
        for stance, methods in n["figure_10"].items()
        if stance != "joints"
        for label, m in methods.items()
    ]
    return markdown_table(("stance", "method", "pairs of joints", "mean cm²", "median cm²"), rows)


def _cm2(value: float) -> str:
    return f"{1e4 * value:.2f}" if math.isfinite(value) else "-"


def _cpu(n: Mapping[str, Any]) -> str:
    if "cpu" not in n:
        return ""
    rows = [
        (
            m["method"],
            f"{1000 * m['one_source_s']:.1f} ({1000 * m['low_s']:.1f}-{1000 * m['high_s']:.1f})",
            f"{1000 * m['fifteen_sources_s']:.0f}",
            f"{1000 * m['build_s']:.0f}",
            "" if m["thesis_s"] is None else f"{1000 * m['thesis_s']:.0f}",
        )
        for m in n["cpu"]["methods"]
    ]
    head = ("method", "one source ms (range)", "15 sources ms", "building ms", "thesis: ms")
    return (
        f"{n['cpu']['points']:,} points, one thread, CPU time of the process.\n\n{markdown_table(head, rows)}"
    )


def _ranking(n: Mapping[str, Any]) -> str:
    if "ranking" not in n:
        return ""
    return "\n".join(f"{k + 1}. {stance}" for k, stance in enumerate(n["ranking"]))


def _error_time(n: Mapping[str, Any]) -> str:
    if "error_against_time" not in n:
        return ""
    rows = [
        (
            r["method"],
            r["stance"],
            f"{r['cpu_s']:.2f}" if math.isfinite(r["cpu_s"]) else "-",
            _mm(r["mean_m"]),
        )
        for r in n["error_against_time"]
    ]
    return markdown_table(("method", "stance", "CPU s per relocation", "mean error mm"), rows)
