"""What to say to a person before and after a capture: cheap live readings, and the verdict of a capture."""

from core.guidance.faults import FAULTS, Fault, label_of
from core.guidance.framing import Reach
from core.guidance.ghost import Ghost
from core.guidance.guide import LiveGuide
from core.guidance.readings import READING_NAMES, Guidance, Reading, State
from core.guidance.verdict import CaptureQuality, Finding, Grade, judge_capture

__all__ = [
    "FAULTS",
    "READING_NAMES",
    "CaptureQuality",
    "Fault",
    "Finding",
    "Ghost",
    "Grade",
    "Guidance",
    "LiveGuide",
    "Reach",
    "Reading",
    "State",
    "judge_capture",
    "label_of",
]
