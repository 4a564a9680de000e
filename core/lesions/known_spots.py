"""The spots of a scan are found once, whoever asks first, and forgotten with the scan."""

from __future__ import annotations

import threading
from concurrent.futures import Future
from weakref import WeakKeyDictionary

from core.lesions.spots import SkinSpots, detect_spots
from core.surface.scan import BodyScan

_lock = threading.Lock()
_found: WeakKeyDictionary[BodyScan, Future[SkinSpots]] = WeakKeyDictionary()


def spots_of(scan: BodyScan) -> SkinSpots:
    """The spots of a scan; whoever asks while another thread looks for them waits for that thread."""
    with _lock:
        known = _found.get(scan)
        if known is None:
            search: Future[SkinSpots] = Future()
            _found[scan] = search
    if known is not None:
        return known.result()
    try:
        search.set_result(detect_spots(scan))
    except BaseException as error:
        with _lock:
            del _found[scan]
        search.set_exception(error)
        raise
    return search.result()
