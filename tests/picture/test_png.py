"""PNG files: the pixels that another program reads are those that were written."""

from __future__ import annotations

import io
from itertools import pairwise

import numpy as np
import pytest
from PIL import Image as Picture

from cltrace.picture import png


def written(pixels: png.Pixels, **options: dict[str, str]) -> bytes:
    file = io.BytesIO()
    png.write_png(file, pixels, **options)
    return file.getvalue()


@pytest.mark.parametrize("shape", [(1, 1), (1, 700, 3), (700, 1, 4), (31, 17), (600, 999, 3), (33, 65, 4)])
def test_what_is_read_is_what_was_written(shape: tuple[int, ...]) -> None:
    """Blocks of rows go over into each other, and a view that is no array of its own is written as it looks."""
    pixels = np.random.default_rng(1).integers(0, 256, shape, np.uint8)
    smooth = np.broadcast_to(np.arange(shape[1], dtype=np.uint8).reshape(1, -1, *[1] * (len(shape) - 2)), shape)
    for wanted in (pixels, smooth, pixels[::-1]):
        with Picture.open(io.BytesIO(written(wanted))) as picture:
            assert picture.format == "PNG"
            assert picture.mode == {1: "L", 3: "RGB", 4: "RGBA"}[shape[2] if len(shape) == 3 else 1]
            assert np.array_equal(np.asarray(picture), wanted)


def test_rows_may_come_in_any_pieces() -> None:
    """More than a chunk of compressed bytes, in pieces of one band and of many."""
    pixels = np.random.default_rng(4).integers(0, 256, (900, 700, 3), np.uint8)
    file = io.BytesIO()
    rows = png.Rows(file, pixels.shape, pixels.dtype)
    for begin, end in pairwise([0, 16, 32, 256, 272, 896, 900]):
        rows.write(pixels[begin:end])
    rows.close()
    assert file.getvalue() == written(pixels)
    assert file.getvalue().count(b"IDAT") > 1


def test_text() -> None:
    data = written(np.zeros((4, 5, 3), np.uint8), text={"other": "x", "cltrace": "abc"})
    assert png.text_of(io.BytesIO(data), "cltrace") == "abc"
    assert png.text_of(io.BytesIO(data), "nothing") is None
    with Picture.open(io.BytesIO(data)) as picture:
        picture.load()
        assert picture.text == {"other": "x", "cltrace": "abc"}
    for cut in range(len(data)):  # what is not whole says nothing
        assert png.text_of(io.BytesIO(data[:cut]), "cltrace") is None
        damaged = bytes([*data[:cut], data[cut] ^ 1, *data[cut + 1 :]])
        assert png.text_of(io.BytesIO(damaged), "cltrace") is None
