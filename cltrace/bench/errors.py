"""How far a picture is off: the metrics that the benchmark reports."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .truth import Answer

# A lit surface may be black where n.l is below what float32 resolves in a unit vector, and, if its highlight has the
# exponent 0, be without it there.
CERTAIN = 2.0**-22


@dataclass(frozen=True)
class Errors:
    """What is wrong with some pixels.

    pixels: how many were compared; wrong_ids: that show another surface than they must, of which `missed` show nothing
    and `invented` show something where there is nothing; t_ulp: largest error of a distance, in ulp of float32, where
    the surface is right (0.5 is its rounding); normal: largest angle between normals, rad; arriving: lights that arrive
    or should, over all pixels; false_shadows, leaks: of them, those that were held up, or that got through; color_max,
    color_rms: of linear colours; bytes_differ, bytes_off: pixels of which a byte differs at all, and by more than a
    level, but not where it is doubtful whether a surface faces a light; not_finite: pixels with a NaN or an infinity.
    """

    pixels: int
    wrong_ids: int
    missed: int
    invented: int
    t_ulp: float
    normal: float
    arriving: int
    false_shadows: int
    leaks: int
    color_max: float
    color_rms: float
    bytes_differ: int
    bytes_off: int
    not_finite: int


def ulps(got: NDArray[np.floating], want: NDArray[np.floating]) -> NDArray[np.floating]:
    """How far distances are off, each rounded to float32, in ulp of float32."""
    # Beyond float32's largest number, in units of that one's.
    most = np.finfo(np.float32).max
    with np.errstate(over="ignore"):
        near = np.where(np.abs(want) > most, got, got.astype(np.float32)).astype(np.longdouble)
        size: NDArray[np.floating] = np.abs(near - want) / np.spacing(np.minimum(want, most).astype(np.float32))
    return size


def angles(got: NDArray[np.floating], want: NDArray[np.floating]) -> NDArray[np.float64]:
    """The angles between vectors (n, 3), rad; by the arc tangent, as a cosine cannot tell small angles."""
    a, b = got.astype(np.float64), want.astype(np.float64)
    out: NDArray[np.float64] = np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), (a * b).sum(axis=1))
    return out


def compare(got: Answer, want: Answer) -> Errors:
    """The errors of `got`. What is compared of a hit is compared where the surface is right."""
    wrong = got.id != want.id
    hit = ~wrong & (want.id >= 0)
    arrives = want.lit[hit] & (want.light[hit] > CERTAIN)
    leaks = got.lit[hit] & ~want.lit[hit]
    finite = np.isfinite(got.color).all(axis=1) & ~np.isnan(got.depth) & np.isfinite(got.normal).all(axis=1)
    color = np.abs(np.where(np.isfinite(got.color), got.color, 0) - want.color)
    sure = ~(want.lit & (want.light <= CERTAIN)).any(axis=1)
    return Errors(
        pixels=len(wrong),
        wrong_ids=int(wrong.sum()),
        missed=int((wrong & (got.id < 0)).sum()),
        invented=int((wrong & (want.id < 0)).sum()),
        t_ulp=float(np.nan_to_num(ulps(got.depth[hit], want.depth[hit]), nan=np.inf).max(initial=0)),
        normal=float(np.nan_to_num(angles(got.normal[hit], want.normal[hit]), nan=np.pi).max(initial=0)),
        arriving=int((arrives | leaks).sum()),
        false_shadows=int((arrives & ~got.lit[hit]).sum()),
        leaks=int(leaks.sum()),
        color_max=float(color.max(initial=0)),
        color_rms=float(np.sqrt(np.mean(color.astype(np.float64) ** 2))) if color.size else 0.0,
        bytes_differ=bytes_apart(got.rgb8, want.rgb8)[0],
        bytes_off=bytes_apart(got.rgb8[sure], want.rgb8[sure])[1],
        not_finite=int((~finite).sum()),
    )


def apart(picture: NDArray[np.uint8], levels: NDArray[np.float64] | NDArray[np.uint8]) -> dict[str, float]:
    """How far a picture is off from a Truth's levels where these are known: differ, off and rms of a Point."""
    known = ~np.isnan(levels[:, 0, 0])
    got, want = picture[known], levels[known].astype(np.float64)
    differ, off = bytes_apart(got, np.rint(want).astype(np.uint8))
    pixels = got[..., 0].size
    return {"differ": differ / pixels, "off": off / pixels, "rms": float(np.sqrt(np.mean((got - want) ** 2)))}


def bytes_apart(got: NDArray[np.uint8], want: NDArray[np.uint8]) -> tuple[int, int]:
    """The numbers of pixels (..., 3) of which a byte differs, and of which one differs by more than a level."""
    apart = np.abs(got.reshape(-1, 3).astype(np.int16) - want.reshape(-1, 3)).max(axis=1, initial=0)
    return int((apart > 0).sum()), int((apart > 1).sum())
