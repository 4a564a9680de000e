"""The log: for bugs and operation, never for patient data."""

from __future__ import annotations

import logging
import logging.handlers
import os
from pathlib import Path

import platformdirs


def log_folder() -> Path:
    """Folder of the log files; ``GEODERM_LOG_DIR`` overrides the platform's place."""
    return Path(os.environ.get("GEODERM_LOG_DIR") or platformdirs.user_log_path("geoderm", appauthor=False))


def log_path() -> Path:
    """The current log file."""
    return log_folder() / "geoderm.log"


def start_logging(level: int = logging.INFO) -> None:
    """Log to the rotating file. A log that cannot be written is no reason to stop a consultation."""
    logger = logging.getLogger("geoderm")
    if logger.handlers:
        return
    logger.setLevel(level)
    logger.propagate = False
    try:
        log_folder().mkdir(parents=True, exist_ok=True)
        handler: logging.Handler = logging.handlers.RotatingFileHandler(
            log_path(), maxBytes=2_000_000, backupCount=5, encoding="utf-8"
        )
    except OSError:
        handler = logging.StreamHandler()
    handler.setFormatter(logging.Formatter("%(asctime)s %(levelname)s %(name)s: %(message)s"))
    logger.addHandler(handler)


def log_bug(where: str) -> Path:
    """Log the exception being handled with its trace; return the file to look at."""
    start_logging()
    logging.getLogger("geoderm").exception("bug in %s", where)
    return log_path()
