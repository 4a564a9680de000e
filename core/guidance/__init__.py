"""What to say to a person before and after a capture: cheap live readings, and the verdict of a capture."""

from core.guidance.framing import Reach
from core.guidance.guide import LiveGuide
from core.guidance.readings import READING_NAMES, Guidance, Reading, State

__all__ = ["READING_NAMES", "Guidance", "LiveGuide", "Reach", "Reading", "State"]
