"""Splitting array work over threads: the compiled kernels hold no lock.

Threads of our own rather than the compiler's: its thread pool may not be entered from two threads at once on
every platform, and the window's background tasks do just that.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager
from functools import cache
from itertools import pairwise

from threadpoolctl import ThreadpoolController

_THREADS = 4


def in_chunks(work: Callable[[int, int], None], count: int, smallest: int) -> None:
    """Call ``work(first, last)`` for ranges of at least ``smallest`` that cover ``count`` items."""
    chunks = max(1, min(4 * _THREADS, count // smallest))
    ranges = list(pairwise(round(i * count / chunks) for i in range(chunks + 1)))
    if len(ranges) == 1:
        work(0, count)
        return
    with ThreadPoolExecutor(_THREADS) as pool:
        for task in [pool.submit(work, first, last) for first, last in ranges]:
            task.result()


def one_linear_algebra_thread() -> AbstractContextManager[object]:
    """For small systems: threads of NumPy's linear algebra library only wait for each other."""
    limited: AbstractContextManager[object] = _controller().limit(limits=1, user_api="blas")
    return limited


@cache
def _controller() -> ThreadpoolController:
    return ThreadpoolController()
