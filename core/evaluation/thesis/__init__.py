"""The thesis's own experiments again: figures 8 to 11, table 2 and CPU time, from any folder of captures."""

from core.evaluation.thesis.clicks import CLICKS_FILE, CLICKS_FORMAT, Clicks, read_clicks, write_clicks
from core.evaluation.thesis.experiments import FIGURES, ThesisResults, Wall, run_thesis
from core.evaluation.thesis.measure import Protocol, measure_stance
from core.evaluation.thesis.records import CaptureRecord
from core.evaluation.thesis.report import report_text, write_results
from core.evaluation.thesis.sequences import ClickedCapture, StanceSequence, find_sequences, read_clicked
from core.evaluation.thesis.timing import MethodTime, time_methods

__all__ = [
    "CLICKS_FILE",
    "CLICKS_FORMAT",
    "FIGURES",
    "CaptureRecord",
    "ClickedCapture",
    "Clicks",
    "MethodTime",
    "Protocol",
    "StanceSequence",
    "ThesisResults",
    "Wall",
    "find_sequences",
    "measure_stance",
    "read_clicked",
    "read_clicks",
    "report_text",
    "run_thesis",
    "time_methods",
    "write_clicks",
    "write_results",
]
