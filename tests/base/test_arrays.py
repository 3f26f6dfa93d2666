"""Large arrays."""

from __future__ import annotations

import numpy as np

from cltrace.base.arrays import copied, widened


def test_rows_are_widened_where_there_is_room() -> None:
    """As copied() makes it, and nobody reads beyond an array's end."""
    for n in (0, 1, 5, 30_000):
        rows = np.arange(3.0 * n).reshape(n, 3)
        roomy = copied(rows, np.float64, 1)
        wide, again, last = widened(roomy, 4, float), widened(rows, 4, float), np.zeros((n, 4))[:, 1:]
        assert np.array_equal(roomy, rows)
        assert np.array_equal(wide[:, :3], rows)
        assert np.array_equal(again[:, :3], rows)
        assert np.shares_memory(wide, roomy) == (n > 0)
        assert not np.shares_memory(again, rows)
        assert not np.shares_memory(widened(last, 4, float), last)
        narrow = widened(roomy, 4, np.float32)
        assert narrow.dtype == np.float32
        assert np.array_equal(narrow[:, :3], rows)
        assert np.shares_memory(widened(rows, 3, float), rows) == (n > 0)
