"""The live picture: frames, skeleton and readings from a camera, without ever holding up the window.

`LiveService` lives in the GUI's thread and owns three threads of its own: one pulls frames and prepares what
is painted, one follows the skeleton, one judges. Each takes the newest frame there is and drops what it
missed.
`CaptureAssistant` decides, without Qt or clock of its own, when a capture is taken.
"""

from app.live.assistant import CaptureAssistant, Phase
from app.live.service import LiveService
from app.live.status import LiveStatus, Shown

__all__ = ["CaptureAssistant", "LiveService", "LiveStatus", "Phase", "Shown"]
