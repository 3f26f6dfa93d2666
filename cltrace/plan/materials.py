"""Materials and textures as the kernel reads them, and what surfaces do with the rays that meet them.

Surfaces absorb rays, mirror them or let them through. A branch of a pixel's tree of rays may be too faint to be traced.
Let nothing in a scene be brighter than B, and let no surface send on more than it gets. Then all that is seen with the
weight w adds w B at most to a pixel, however it branches. So the kernel drops branches with a small w B, sums up what
they might have added, and is done if no output would be another with all of that. Else it traces the pixel again with a
lower limit: see follow() in kernels/shade/tree_of_rays.cl.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cltrace.base.arrays import BLOCK, blockwise, empty, joined
from cltrace.plan.abi import CONSTANTS, Precision, real_dtype, shade_dtype
from cltrace.plan.request import Request
from cltrace.plan.rounding import Array, Mask
from cltrace.scene import AMBIENT, FULL, Scene, Texture, Vector

# Of a material: how much of the light goes on, mirrored and refracted.
GO_ON = ("reflectance", "transmittance")


@dataclass(frozen=True)
class Materials:
    """m materials.

    packed: (m, 8) of shade_dtype(): ka La C (rgb), kd C (rgb), ks, exponent, with La the ambient light and C the
    material's colour, linear; bounce: (m, 4) of real_dtype(): reflectance, transmittance, index of refraction, 0; empty
    where nothing mirrors or is transparent; texture: (m,), the index of each one's texture in the scene, -1 for none;
    empty where there are none; black: (m,), which ones reflect nothing of any light that is not ambient, or None if all
    of them reflect; brightest: the largest ks.
    """

    packed: NDArray[Any]
    bounce: NDArray[Any]
    texture: NDArray[np.int32]
    black: Mask | None
    brightest: float

    @classmethod
    def of(cls, scene: Scene, request: Request, which: NDArray[np.int32] | None) -> Materials:
        """Materials of a scene in its ambient light. which: (m,), their indices in the scene, None for all of them."""
        columns, precision = scene.columns, request.precision
        shade, m = columns.every_shade(), columns.materials_count if which is None else len(which)
        ambient = scene.lights["color"][scene.lights["kind"] == AMBIENT].sum(axis=0)

        def some(name: str, rows: slice) -> Array:
            column = shade[name]
            if column.ndim == (name == "color"):
                return np.asarray(column, np.float64)
            return np.asarray(column[rows] if which is None else column.take(which[rows], axis=0), np.float64)

        packed = empty((m, 8), shade_dtype(precision))

        def pack(rows: slice) -> None:
            ka, kd, ks, exponent, color = (some(name, rows) for name in ("ka", "kd", "ks", "exponent", "color"))
            # Column by column: numpy's loops over the three parts of each colour would take twice as long.
            for k in range(3):
                packed[rows, k] = finite32(ka * ambient[k] * color[..., k])
                packed[rows, 3 + k] = finite32(kd * color[..., k])
            packed[rows, 6], packed[rows, 7] = finite32(ks), finite32(exponent)

        blockwise(m, pack)
        black = None
        if not shade["ks"].all():
            black = np.empty(m, bool)
            for rows in (slice(i, i + BLOCK) for i in range(0, m, BLOCK)):
                kd, ks, color = (some(name, rows) for name in ("kd", "ks", "color"))
                black[rows] = (ks == 0) & ((kd == 0) | ~color.any(axis=-1))
        bounce = empty((m if may_bounce(scene, request) else 0, 4), real_dtype(precision))
        for k, name in enumerate((*GO_ON, "index")):
            bounce[:, k] = some(name, slice(len(bounce)))
        bounce[:, 3] = 0
        texture = shade["texture"] if scene.textures else np.zeros(0, np.int32)
        return cls(
            packed,
            bounce,
            texture if which is None or not len(texture) else texture.take(which),
            black=black,
            brightest=float(shade["ks"].max(initial=0)),
        )

    def reflect(self, material_of: NDArray[np.integer[Any]]) -> bool:
        """Whether some surface reflects light that is not ambient. material_of: (n,), indices of their materials."""
        if self.black is None:
            return len(material_of) > 0
        return not self.black[used(len(self.black), material_of)].all()


def may_bounce(scene: Scene, request: Request) -> bool:
    """Whether some material mirrors or is transparent, or is to be treated so."""
    shade = scene.columns.every_shade()
    return any(shade[name].any() for name in GO_ON) or "bounces" in request.keep


def used(count: int, material_of: NDArray[np.integer[Any]]) -> NDArray[np.bool_]:
    """(count,): which materials some sphere has. material_of: (n,), of the spheres."""
    mask = np.zeros(count, bool)
    mask[material_of] = True
    return mask


def finite32(value: Array) -> Array:
    """The values, with half of float32's largest number in place of larger ones: the sum of two is a number, too.

    Products of colours may be as large; they are white in any picture.
    """
    return np.minimum(value, float(np.finfo(np.float32).max) / 2)


# The kernel reads so many bytes from where a texel begins, so as many follow the last one.
BYTES_READ = 8
# A square of texels is uneven in which some differ by more than so many levels of 255, of red, green or blue.
UNEVEN = 100


NO_TEXTURES: dict[str, NDArray[Any]] = {
    "texel": np.zeros(0, np.uint8),
    "texture": np.zeros((0, 4), np.int32),
    "texture_of": np.zeros(0, np.int32),
}


def packed_textures(
    images: tuple[Texture, ...],
    of_material: NDArray[np.integer[Any]],
    material_of: NDArray[np.integer[Any]],
    squares: bool = False,
) -> dict[str, NDArray[Any]]:
    """Those k textures of a scene that some surface shows, each of them once, as the kernel's buffers by name.

    texel: (n,) uint8, red, green and blue of all texels, row by row from the top, one byte each or two, and with
    `squares`, behind each texture, which squares of its texels are uneven; texture: (k, 4) int32; texture_of: (m,)
    int32, the index of each material's texture among the k, -1 for none.

    images: all of them; of_material: (m,), the index of each material's image, -1 for none; material_of: (n,), the
    index of each surface's material; squares: whether to find the uneven ones.
    """
    shown = of_material[used(len(of_material), material_of)] if images else of_material[:0]
    mask = used(len(images), shown[shown >= 0])
    if not mask.any():
        return NO_TEXTURES
    new = np.full(len(images) + 1, -1, np.int32)  # the last one is for -1
    new[:-1][mask] = np.arange(mask.sum())
    texels: list[NDArray[np.uint8]] = []
    places, begin = [], 0
    for i in np.flatnonzero(mask).tolist():
        height, width = images[i].shape[:2]
        # MAX_TEXELS of 6 bytes each are less than 2^31.
        full = FULL[images[i].dtype]
        places.append((width, height, begin, full))
        # The kernel reads unsigned numbers, so signed ones are stored with `full` added.
        stored = (images[i] + full).astype(np.uint16) if full == CONSTANTS["SIGNED_FULL"] else images[i]
        uneven = uneven_squares(images[i]) if squares else np.zeros(0, np.uint8)
        texels += [stored.reshape(-1).view(np.uint8), uneven]
        begin += images[i].nbytes + len(uneven)
    texel = joined([*texels, np.zeros(BYTES_READ, np.uint8)])  # a CPU's driver reads it in place
    return {"texel": texel, "texture": np.array(places, np.int32).reshape(-1, 4), "texture_of": new[of_material]}


def uneven_squares(image: Texture) -> NDArray[np.uint8]:
    """For each square of SQUARE x SQUARE texels, row by row, 1 if it is uneven, else 0."""
    rows, columns = (np.arange(0, n, CONSTANTS["SQUARE"]) for n in image.shape[:2])
    low, high = (f.reduceat(f.reduceat(image, rows, 0), columns, 1).astype(np.int32) for f in (np.minimum, np.maximum))
    return np.asarray(255 * (high - low).max(axis=2) > UNEVEN * FULL[image.dtype]).astype(np.uint8).reshape(-1)


# The numbers of waiting rays that programs have room for: one for each depth of 0 .. max_bounces.
ROOMS = (9, 17, 33, 65, 101)
# With reflectance + transmittance up to this, dropping branches saved time: 0.9 took 0.7 to 0.9 of it, 1 took 1.7.
FADING = 0.95


@dataclass(frozen=True)
class Bounces:
    """What some surface does.

    any: whether some surface mirrors or is transparent; glass: whether some is transparent; splits: whether some does
    both, which makes two rays of one; most: the largest reflectance + transmittance.
    """

    any: bool
    glass: bool
    splits: bool
    most: float

    @classmethod
    def of(cls, bounce: NDArray[Any], material_of: NDArray[np.integer[Any]], full: bool) -> Bounces:
        """bounce: of Materials; material_of: (n,), of the spheres; full: whether to expect everything of them."""
        r, t = (bounce[used(len(bounce), material_of)] if len(bounce) else bounce)[:, :2].T
        most = float((r + t).max(initial=0))
        return cls(full or most > 0, full or bool(t.any()), full or bool(((r > 0) & (t > 0)).any()), most)

    @property
    def shrinks(self) -> bool:
        """Whether what goes on from a surface never weighs more than what came."""
        return self.most <= 1

    def fades(self, max_bounces: int) -> bool:
        """Whether it pays to drop what is faint.

        Where all that comes goes on, so much is dropped that most pixels are traced again.
        Then it is worth a try only where a tree might be too large without.
        """
        return self.most <= FADING or self.overgrows(max_bounces)

    def growth(self, max_bounces: int) -> float:
        """How much all rays of a pixel together may weigh, 1 being one ray; 1e200 stands for all that is more."""
        return math.exp(min(math.log(1e200), math.log(max(1.0, self.most)) * (max_bounces + 1)))

    def overgrows(self, max_bounces: int) -> bool:
        """Whether a pixel may take more than MOST_RAYS rays.

        Where nothing splits, there are max_bounces + 2 at most. A tree that splits everywhere has 2^depth rays of each
        depth up to max_bounces + 1.
        """
        return self.splits and 2 ** (max_bounces + 2) - 1 > CONSTANTS["MOST_RAYS"]

    def branches(self, max_bounces: int) -> int:
        """How many rays of a pixel may wait for others: one for each depth at most."""
        return next(n for n in ROOMS if n > max_bounces) if self.splits else ROOMS[0]


NO_BOUNCES = Bounces(False, False, False, 0.0)


# Sums count in such parts.
PARTS = 2.0**40
# The first limit of w B, for bytes and for floats of colours; 1 is full. Seconds of processor that a frame of 320x240
# takes, of those that it takes without dropping, where 12 balls have the reflectance r and the transmittance t and rays
# bounce up to n times (PoCL 3.1, bytes):
#
#                        2^-8  2^-12  2^-14  2^-16  2^-18  2^-20
#   r 0.4, t 0.5, n  8   1.5   1.0    0.9    0.9    1.0    0.9
#   r 0.4, t 0.5, n 16   0.9   0.8    0.8    0.7    0.7    0.9
#   r 0.3, t 0.3, n 12   0.6   0.6    0.5    0.5    0.6    0.6
#   r 0.2, t 0.8, n 16   2.0   1.9    1.9    1.7    1.9    1.7
#
# With r + t = 1 nothing is lost on the way, and the more is in what is dropped. Floats need so small limits that little
# is left to drop: 0.9, 0.9, 1.0, 1.4 with 2^-32.
FAINT, FAINT_FOR_FLOATS = 2.0**-16, 2.0**-32
# The same for samples of a pixel's mean, which may lack 2^-11 each: MOST_DROPPED of kernels/shade/tree_of_rays.cl.
FAINT_FOR_SAMPLES = 2.0**-13


def brightest(
    materials: Materials, material_of: NDArray[np.integer[Any]], lights: NDArray[np.void], background: Vector
) -> Array:
    """(3,): more than any surface or the background shows of red, green and blue.

    That is ka La C and, for each light, (kd C + ks) L, since no cosine, no lobe and no share of a spot light exceeds 1.
    What the kernel computes may exceed it by roundings, of a factor 1 + u each, u = 2^-24. A light's part takes fewer
    than 12 of them, and adding up those of 1,024 lights 1,024. A weight is a product of up to 101 factors; at each
    surface those of both branches and the share of its own colour add up to 1 but for 4 roundings, one of them that of
    the product. So all that is seen with a weight exceeds it by less than 1,500 u and its square: less than 2^-12.
    """
    packed = materials.packed[used(len(materials.packed), material_of)].astype(np.float64)
    light = lights["color"].astype(np.float64).sum(axis=0)
    shown = packed[:, 0:3] + (packed[:, 3:6] + packed[:, 6:7]) * light
    return np.asarray(np.maximum(shown.max(axis=0, initial=0), background) * (1 + 2.0**-12))


def limits(bounces: Bounces, peak: Array, request: Request) -> dict[str, Any]:
    """The kernel's arguments `brightest` and `faint`. peak: of brightest()."""
    largest = float(np.finfo(real_dtype(request.precision)).max)
    parts = [value if value <= largest else math.inf for value in (peak * PARTS).tolist()]
    faint = FAINT_FOR_FLOATS if "color" in request.outputs else FAINT
    if request.means:
        faint = FAINT_FOR_SAMPLES
    return {"brightest": (*parts, max(parts)), "faint": faint * PARTS if bounces.shrinks else -1.0}


# Up to these, float's colours are within 1/16 of a byte's level of double's. Let u = 2^-24, let A be what lights and
# materials together can add to a pixel, and E an exponent. What is brighter than white is white, so only colours up to
# 1 count.
# n.l is off by 4 u at most, and so what is diffuse by 255 * 4 u A levels: 0.016.
BRIGHTEST = 2.0**8
# A highlight is A exp(-E |e|^2 / 2) where e = r - v is small. |e| is off by d = 12 u at most, as each part of it is off
# by a few u, and so the highlight by E |e| d times itself. With at most 1 of it left, that is largest where it has just
# come down to 1, |e|^2 = 2 ln(A) / E, and for A < e^(1/2) where |e|^2 = 1 / E. There it is sqrt(E max(1, 2 ln(A))) d,
# which is 0.047 levels.
SHARPEST = 2.0**16
# With an exponent E < 1 the highlight is steep where r.v is 0, and ends there: what is off by d may lose all of d^E,
# which is 0.053 levels here, and more of lower ones. With E = 0 it does not end.
FLATTEST = 0.6


def precision_for(scene: Scene, precision: Precision) -> Precision:
    """What a precision that was asked for means for the colours of a scene: "accurate" becomes "double" where needed.

    Both decide alike, so nothing but colours depends on it.
    """
    if precision != "accurate":
        return precision
    shade = scene.columns.every_shade()
    kd, ks, color, exponent = (float(shade[name].max(initial=0)) for name in ("kd", "ks", "color", "exponent"))
    goes_on = float((shade["reflectance"] + shade["transmittance"]).max(initial=0))
    light = float(scene.lamps["color"].sum(axis=0).max(initial=0))
    light *= replace(NO_BOUNCES, most=goes_on).growth(scene.camera.max_bounces)
    flat = bool(((shade["exponent"] > 0) & (shade["exponent"] < FLATTEST)).any())
    sharp = exponent * max(1.0, 2 * math.log(max(1.0, ks * light))) > SHARPEST
    bright = max(kd * color, ks) * light > BRIGHTEST
    return "double" if bright or ((flat or sharp) and ks * light > 0) else precision
