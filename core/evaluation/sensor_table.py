"""The accuracy of one program with several depth sensors: a row for each, on the same people and lesions."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from core.capture.sensors import SensorModel
from core.errors import WorkError
from core.evaluation.cases import OTHER, SAME
from core.evaluation.records import FLOOR, Record, Rung
from core.evaluation.summaries import Summary, scored, summarise
from core.relocation import write_json

FORMAT = "geoderm-sensors/1"
USUAL_M = 2.3


@dataclass(frozen=True)
class SkinError:
    """What is wrong with the skin of one capture, and with distances along it.

    Attributes
    ----------
    case, sensor : str
    depth_mm : float
        RMS of the skin's error along the line of sight.
    normal_deg : float
        Median angle between a vertex's normal and the true one.
    lengths_mm : tuple of float
        True lengths of shortest paths between lesions.
    errors_mm : tuple of float
        The same paths on the measured skin, less the true length.
    """

    case: str
    sensor: str
    depth_mm: float
    normal_deg: float
    lengths_mm: tuple[float, ...]
    errors_mm: tuple[float, ...]

    def to_json(self) -> dict[str, Any]:
        """A dictionary of plain values."""
        return asdict(self)


@dataclass(frozen=True)
class PathErrors:
    """How far shortest paths on measured skins are from the true ones."""

    paths: int
    mean_mm: float
    p95_mm: float
    share: float
    bias: float


def path_errors(skins: Sequence[Mapping[str, Any]], sensor: str) -> PathErrors | None:
    """Over all paths of a sensor, from `SkinError.to_json`; None without any. Shares are of the length."""
    own = [skin for skin in skins if skin["sensor"] == sensor]
    length = np.array([x for skin in own for x in skin["lengths_mm"]])
    error = np.array([x for skin in own for x in skin["errors_mm"]])
    if len(length) == 0:
        return None
    return PathErrors(
        len(length),
        float(np.abs(error).mean()),
        float(np.percentile(np.abs(error), 95)),
        float(np.abs(error / length).mean()),
        float((error / length).mean()),
    )


@dataclass(frozen=True)
class SensorRow:
    """One rung with one sensor in one stance class."""

    sensor: str
    rung: Rung
    group: str
    pairs: int
    failures: int
    summary: Summary


def sensor_rows(records: Mapping[str, Sequence[Record]], rungs: Sequence[Rung]) -> list[SensorRow]:
    """Rows by stance class, rung and sensor; ``records`` are those of each sensor."""
    out = []
    for group in (SAME, OTHER):
        for rung in rungs:
            for sensor, all_records in records.items():
                some = [r for r in all_records if r.rung == rung and r.name.group == group]
                good = [r for r in some if not r.failure]
                if some:
                    failed = len(some) - len(good)
                    out.append(SensorRow(sensor, rung, group, len(some), failed, summarise(scored(good))))
    return out


def sensors_document(
    models: Sequence[SensorModel],
    rows: Sequence[SensorRow],
    skins: Sequence[SkinError],
    about: Mapping[str, Any],
) -> dict[str, Any]:
    """The document ``geoderm-sensors/1``."""
    return {
        "format": FORMAT,
        "about": dict(about),
        "sensors": [
            {"name": m.name, "title": m.title, "principle": m.principle, "fingerprint": m.fingerprint}
            for m in models
        ],
        "rows": [
            {
                "sensor": row.sensor,
                **asdict(row.rung),
                "group": row.group,
                "pairs": row.pairs,
                "failures": row.failures,
                **row.summary.to_json(),
            }
            for row in rows
        ],
        "skin": [skin.to_json() for skin in skins],
    }


def sensors_markdown(
    models: Sequence[SensorModel],
    rows: Sequence[SensorRow],
    skins: Sequence[SkinError],
    about: Mapping[str, Any],
) -> str:
    """The tables for people."""
    lines = [
        "# Accuracy by depth sensor",
        "",
        "The same simulated people, stances, lesions and clicks before each sensor. None was real: "
        "frames are drawn from the models in resources/sensors. Each stands where it and an auxiliary colour "
        "camera, the same for all, see the whole patient.",
        "",
        *(f"* {key}: {value}" for key, value in about.items()),
        "",
        "## The sensors, at 2.3 m, skin square to the camera (mm)",
        "",
        "| sensor | one reading | step | what 30 frames leave | the same, smoothed | pixel on the skin |",
        "|---|---|---|---|---|---|",
    ]
    for m in models:
        figures = (
            m.axial_sigma(USUAL_M),
            m.quantisation_step(USUAL_M),
            m.fused_sigma(USUAL_M, 30),
            m.skin_sigma(USUAL_M, 30),
            USUAL_M / m.depth_camera.fx,
        )
        lines.append(f"| {m.title} | " + " | ".join(f"{1000 * float(f):.1f}" for f in figures) + " |")
    lines += ["", "## Skin and distances along it, against the true body", "", *_skin_table(models, skins)]
    for group in (SAME, OTHER):
        some = [row for row in rows if row.group == group]
        if some:
            lines += ["", f"## Relocation, {group} (errors in mm)", "", *_relocation_table(some)]
    return "\n".join(lines) + "\n"


def _skin_table(models: Sequence[SensorModel], skins: Sequence[SkinError]) -> list[str]:
    out = [
        "| sensor | captures | depth RMS | normals, median | paths | path error, mean | P95 "
        "| of the length, mean | bias |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for model in models:
        own = [skin for skin in skins if skin.sensor == model.name]
        if not own:
            continue
        paths = path_errors([skin.to_json() for skin in own], model.name)
        depth = float(np.sqrt(np.mean([skin.depth_mm**2 for skin in own])))
        normal = float(np.mean([skin.normal_deg for skin in own]))
        cells = [model.name, f"{len(own)}", f"{depth:.1f} mm", f"{normal:.1f} deg"]
        if paths is None:
            cells += ["0", *["-"] * 4]
        else:
            cells += [
                f"{paths.paths}",
                f"{paths.mean_mm:.1f} mm",
                f"{paths.p95_mm:.1f} mm",
                f"{100 * paths.share:.2f} %",
                f"{100 * paths.bias:+.2f} %",
            ]
        out.append("| " + " | ".join(cells) + " |")
    return out


def _relocation_table(rows: Sequence[SensorRow]) -> list[str]:
    out = [
        "| row | sensor | pairs | lesions | answered | mean | median | P95 | within 10 mm | beside the floor "
        "| 95 % region held | its radius, median |",
        "|---|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        s = row.summary
        mean = f"{_mm(s.mean_mm.value)} ({_mm(s.mean_mm.low)}-{_mm(s.mean_mm.high)})"
        floor = row.rung.method == FLOOR
        cells = (
            row.rung.label,
            row.sensor,
            f"{row.pairs}" + (f" ({row.failures} failed)" if row.failures else ""),
            f"{s.lesions}",
            _percent(s.answered),
            mean,
            _mm(s.median_mm),
            _mm(s.p95_mm.value),
            _percent(s.within_10mm.value),
            "-" if floor else _mm(s.beside_floor_mm),
            "-" if floor else _percent(s.in_radius.value),
            "-" if floor else _mm(s.radius_mm),
        )
        out.append("| " + " | ".join(cells) + " |")
    return out


def _mm(value: float) -> str:
    return "-" if math.isnan(value) else f"{value:.1f}"


def _percent(value: float) -> str:
    return "-" if math.isnan(value) else f"{100 * value:.0f} %"


def write_sensors(document: Mapping[str, Any], text: str, folder: Path) -> list[Path]:
    """Write sensors.json and sensors.md and return them.

    Raises
    ------
    WorkError
        If they cannot be written.
    """
    try:
        write_json(folder / "sensors.json", document)
        (folder / "sensors.md").write_text(text, encoding="utf-8")
    except OSError as error:
        raise WorkError(f"{folder}: cannot be written ({error.strerror or error}).") from error
    return [folder / "sensors.md", folder / "sensors.json"]
