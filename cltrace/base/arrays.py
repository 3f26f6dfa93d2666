"""Work on large arrays: in blocks, on all processors. Numpy works outside of Python's lock."""

from __future__ import annotations

import math
import os
from collections import deque
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, TypeVar

import numpy as np
from numpy.typing import DTypeLike, NDArray

T = TypeVar("T")

# Rows at a time: of doubles, their temporary arrays stay in a processor's cache.
BLOCK = 2**15
# Numbers at a time, whatever a row has.
NUMBERS = 2**16
# Rows of a picture at a time.
ROWS = 64
# The most bytes of an array that glibc takes as a hint, see keep_freed_memory().
HINT = 31 * 2**20
# Arrays of at least so many bytes begin on a page.
LARGE = 2**16
PAGE = 4096


def by_rows(make: Callable[[slice], Any], shape: tuple[int, ...], dtype: DTypeLike) -> NDArray[Any]:
    """An array of which make(slice) makes some rows at a time, so that what that takes in between stays small, and
    signals are heard.
    """
    made = np.empty(shape, dtype)
    for i in range(0, len(made), ROWS):
        made[i : i + ROWS] = make(slice(i, i + ROWS))
    return made


def blockwise(n: int, work: Callable[[slice], T], rows: int = BLOCK) -> list[T]:
    """work(slice) for blocks of n rows, one at least, on all processors."""
    return concurrently([partial(work, slice(i, min(i + rows, n))) for i in range(0, max(n, 1), rows)])


def concurrently(jobs: Sequence[Callable[[], T]]) -> list[T]:
    """What the jobs return, by as many threads as there are processors.

    This thread is one of them: each other one has memory of its own, which it first has to get from the system.
    """
    others = min(processors(), len(jobs)) - 1
    if others < 1:
        return [job() for job in jobs]
    from concurrent.futures import ThreadPoolExecutor  # small scenes do without it

    rest, found = deque(enumerate(jobs)), dict[int, T]()

    def work() -> None:
        while True:
            try:
                i, job = rest.popleft()
            except IndexError:
                return
            found[i] = job()

    with ThreadPoolExecutor(others) as pool:
        done = [pool.submit(work) for _ in range(others)]
        try:
            work()
            for future in done:
                future.result()
        finally:  # after an error or a signal nobody goes on
            rest.clear()
    return [found[i] for i in range(len(jobs))]


def processors() -> int:
    """How many this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def physical_memory() -> float:
    """Bytes that this computer has."""
    return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") if hasattr(os, "sysconf") else math.inf


def empty(shape: tuple[int, ...], dtype: DTypeLike) -> NDArray[Any]:
    """np.empty(shape, dtype), which begins on a page if it is large: a CPU's driver can then use it as it is."""
    kind = np.dtype(dtype)
    count = int(np.prod(shape, dtype=np.int64)) * kind.itemsize
    if count < LARGE:
        return np.empty(shape, kind)
    room = np.empty(count + PAGE, np.uint8)
    start = -room.ctypes.data % PAGE
    return room[start : start + count].view(kind).reshape(shape)


def copied(array: NDArray[Any], dtype: DTypeLike, more: int = 0) -> NDArray[Any]:
    """A copy of this dtype, in C order, which begins on a page if it is large.

    more: so many zeros are kept behind each row, which the result, a view, does not show: see widened().
    """
    room = empty((*array.shape[:-1], array.shape[-1] + more), dtype)
    out = room[..., : array.shape[-1]] if more else room

    def copy(rows: slice) -> None:
        with np.errstate(over="ignore"):
            out[rows] = array[rows]
        if more:
            room[rows, -more:] = 0

    blockwise(len(array), copy, rows_in(array))
    return out


def widened(rows: NDArray[Any], width: int, dtype: DTypeLike) -> NDArray[Any]:
    """Rows of numbers as rows of so many of this dtype, whose last numbers are undefined.

    It is the same memory if the dtype is that of the rows and copied() has kept so many behind them.
    """
    more, step = width - rows.shape[1], width * rows.itemsize
    room = rows.base if rows.strides == (step, rows.itemsize) and rows.dtype == dtype else None
    if not isinstance(room, np.ndarray) or rows.ctypes.data + len(rows) * step > room.ctypes.data + room.nbytes:
        rows = copied(rows, dtype, more)
    return np.lib.stride_tricks.as_strided(rows, (len(rows), width), (width * rows.itemsize, rows.itemsize))


def rows_in(array: NDArray[Any]) -> int:
    """How many rows of an array are a block that stays in a processor's cache while it is copied or checked."""
    return max(1, NUMBERS // max(1, array[:1].size))


def joined(arrays: Sequence[NDArray[Any]]) -> NDArray[Any]:
    """Arrays one after the other, along their first axis. It begins on a page if it is large, or is the only one."""
    some = [array for array in arrays if len(array)] or arrays[:1]
    if len(some) == 1:
        return some[0]
    out = empty((sum(map(len, some)), *some[0].shape[1:]), some[0].dtype)
    return np.concatenate(some, out=out)


def keep_freed_memory() -> None:
    """For work on many arrays, one after the other: what they leave is not given back to the system in between.

    To get it again, page by page, can take longer than the work. glibc keeps what is free as long as that is less than
    twice the largest array that was ever freed, up to 32 MB, and it takes such arrays from what it keeps.
    """
    np.empty(HINT, np.uint8)


def begins_on_page(array: NDArray[Any]) -> bool:
    """Whether an array is as those of empty() that are large."""
    return array.flags.c_contiguous and array.nbytes >= LARGE and array.ctypes.data % PAGE == 0
