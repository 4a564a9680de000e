"""Evaluation: the accuracy ladder, scored on captures and truths handed to it."""

from core.evaluation.baselines import BASELINES, register_baselines
from core.evaluation.cases import CaseSource, EvaluationCase, TrueLesion
from core.evaluation.ladder import LADDER, LadderRow, run_ladder
from core.evaluation.scores import LesionScore, Summary, score_lesions, sensor_floor, summarise

__all__ = [
    "BASELINES",
    "LADDER",
    "CaseSource",
    "EvaluationCase",
    "LadderRow",
    "LesionScore",
    "Summary",
    "TrueLesion",
    "register_baselines",
    "run_ladder",
    "score_lesions",
    "sensor_floor",
    "summarise",
]
