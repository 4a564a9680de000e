"""Spots of a scan are found once and forgotten with it."""

import gc
import weakref
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import core.lesions.known_spots as known_spots
from core.lesions import detect_spots, spots_of
from core.surface import scan_body
from tests.core.lesions.conftest import Disc, trunk


def test_spots_are_found_once_however_many_threads_ask() -> None:
    scan = scan_body(trunk([Disc(600, 480, 6.0), Disc(700, 520, 5.0)]))
    with ThreadPoolExecutor(4) as pool:
        answers = list(pool.map(lambda _: spots_of(scan), range(8)))
    assert all(answer is answers[0] for answer in answers)
    np.testing.assert_array_equal(answers[0].pixels, detect_spots(scan).pixels)
    assert len(answers[0]) >= 2


def test_a_search_that_failed_is_made_again(monkeypatch: pytest.MonkeyPatch) -> None:
    scan = scan_body(trunk([Disc(600, 480, 6.0)]))

    def fail(_: object) -> None:
        raise MemoryError

    with monkeypatch.context() as patch:
        patch.setattr(known_spots, "detect_spots", fail)
        with pytest.raises(MemoryError):
            spots_of(scan)
    assert len(spots_of(scan)) >= 1


def test_spots_do_not_keep_their_scan() -> None:
    scan = scan_body(trunk([Disc(600, 480, 6.0)]))
    spots_of(scan)
    alive = weakref.ref(scan)
    del scan
    gc.collect()
    assert alive() is None
