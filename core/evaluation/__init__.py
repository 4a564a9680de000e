"""Evaluation: the accuracy ladder, scored on captures and truths handed to it."""

from core.evaluation.cases import (
    OTHER,
    SAME,
    CaseName,
    CaseSource,
    EvaluationCase,
    Joints,
    PendingCase,
    TrueLesion,
    TrueSpots,
)
from core.evaluation.ladder import ladder_rungs, run_ladder
from core.evaluation.methods import BASELINES, baselines_registered, check_methods, ladder_methods
from core.evaluation.parts import PARTS, BodyMap, BodyPlace
from core.evaluation.records import FLOOR, Journal, Record, Rung, code_fingerprint
from core.evaluation.report import LadderReport, make_report, markdown, write_report
from core.evaluation.residuals import write_residuals
from core.evaluation.scores import LesionScore, SpotScore, score_lesions, score_spots, sensor_floor
from core.evaluation.summaries import Interval, Summary, summarise

__all__ = [
    "BASELINES",
    "FLOOR",
    "OTHER",
    "PARTS",
    "SAME",
    "BodyMap",
    "BodyPlace",
    "CaseName",
    "CaseSource",
    "EvaluationCase",
    "Interval",
    "Joints",
    "Journal",
    "LadderReport",
    "LesionScore",
    "PendingCase",
    "Record",
    "Rung",
    "SpotScore",
    "Summary",
    "TrueLesion",
    "TrueSpots",
    "baselines_registered",
    "check_methods",
    "code_fingerprint",
    "ladder_methods",
    "ladder_rungs",
    "make_report",
    "markdown",
    "run_ladder",
    "score_lesions",
    "score_spots",
    "sensor_floor",
    "summarise",
    "write_report",
    "write_residuals",
]
