"""Materials: a colour or a texture, shaded after Phong; what they mirror and let through."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from copy import copy
from dataclasses import dataclass, fields
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cltrace.base.limits import MAX_TEXELS
from cltrace.scene.colors import Transfer, color_numbers, decoded
from cltrace.scene.rules import (
    ANY,
    NOT_NEGATIVE,
    Vector,
    check_none,
    check_not_bytes,
    check_rule,
    checked,
    described,
    is_masked,
    vector,
)

MATERIAL = np.dtype(
    [
        ("color", "f8", (3,)),  # linear, 1 = full
        ("ka", "f8"),  # share of the colour in ambient light
        ("kd", "f8"),  # share of the colour in diffuse light
        ("ks", "f8"),  # strength of the highlight
        ("exponent", "f8"),  # the larger, the smaller the highlight
        ("reflectance", "f8"),  # share of the light that is mirrored
        ("transmittance", "f8"),  # share of the light that is let through, refracted
        ("index", "f8"),  # index of refraction inside, 1 outside; counts only where transmittance > 0
        ("texture", "i4"),  # index into the scene's textures, by which the colour is multiplied; -1: none
    ]
)
Texture = NDArray[np.uint8] | NDArray[np.uint16] | NDArray[np.int16]
# The number of a texel that is full. Those of int16 are made of the colours of meshes, which need -1 to 2 times that,
# and are linear with any transfer curve. A multiple of 255, so that bytes are exact.
SIGNED_FULL = 42 * 255
FULL = {np.dtype(np.uint8): 255, np.dtype(np.uint16): 65535, np.dtype(np.int16): SIGNED_FULL}
COEFFICIENTS = ("ka", "kd", "ks", "exponent", "reflectance", "transmittance")


class Frozen:
    """A dataclass of read-only arrays, in pickles too, which have the fields and not what is worked out from them."""

    def changed(self, **values: Any) -> Self:
        """The same with other fields, which are neither checked nor copied.

        It shares the others, and what has been worked out from them.
        """
        made = copy(self)
        made.__setstate__(vars(self) | values)
        return made

    def __getstate__(self) -> dict[str, Any]:
        state = {f.name: vars(self)[f.name] for f in fields(self)}  # type: ignore[arg-type]
        # Of an array in C order, a pickle may have the memory beside it, which dask then does not copy.
        return {k: np.asarray(v, order="C") if isinstance(v, np.ndarray) else v for k, v in state.items()}

    def __setstate__(self, state: Mapping[str, Any]) -> None:
        for name, value in state.items():
            parts = value.values() if isinstance(value, Mapping) else value if isinstance(value, tuple) else (value,)
            for array in parts:
                if isinstance(array, np.ndarray):
                    array.flags.writeable = False
            object.__setattr__(self, name, value)


@dataclass(frozen=True, eq=False, init=False, repr=False)
class Material(Frozen):
    """What a mesh is made of. Immutable; meshes may share one.

    color: linear, 1 = full, 3 numbers >= 0, or a text such as "gold" or "#ffd700", as in Scene.from_spheres; ka, kd,
    ks: how strongly the surface shows ambient light, diffuse light and highlights; without ka it is kd; exponent: the
    larger, the smaller the highlight; reflectance, transmittance: the shares of the light that it mirrors and lets
    through; index: of refraction inside, > 0 where transmittance > 0; each a number >= 0, as in Scene.from_spheres.

    texture: an image by which the colour is multiplied, or None: an array of uint8 or uint16, (h, w, 3) RGB, (h, w, 4)
    with alpha, which is ignored, or (h, w) grey, the top row first, 255 or 65535 = full; or an image of Pillow in one
    of the modes L, RGB, RGBA and I;16. The attribute is (h, w, 3) and read-only; handed to another Material, it is
    shared, where any other array is copied.

    Raises ValueError, which names the argument.
    """

    color: Vector
    ka: float
    kd: float
    ks: float
    exponent: float
    reflectance: float
    transmittance: float
    index: float
    texture: Texture | None

    def __init__(
        self,
        color: ArrayLike = (1.0, 1.0, 1.0),
        ka: float | None = None,
        kd: float = 0.8,
        ks: float = 0.5,
        exponent: float = 50.0,
        reflectance: float = 0.0,
        transmittance: float = 0.0,
        index: float = 1.0,
        texture: Any = None,
    ) -> None:
        shown = vector("material.color", color_numbers("material.color", color), NOT_NEGATIVE)
        check_not_bytes("material.color", shown, reflected=True)
        given = {"kd": kd, "ks": ks, "exponent": exponent, "reflectance": reflectance, "transmittance": transmittance}
        given |= {} if ka is None else {"ka": ka}
        values = {name: float(checked(f"material.{name}", NOT_NEGATIVE, value, ())) for name, value in given.items()}
        number = checked("material.index", ANY, index, ())
        check_index("material.index", number, np.array(values["transmittance"]))
        image = None if texture is None else texels("material.texture", texture)
        self.__setstate__({"color": shown, "ka": values["kd"], **values, "index": float(number), "texture": image})

    def __repr__(self) -> str:
        image = None if self.texture is None else f"<{described(self.texture)}>"
        values = vars(self) | {"texture": image}
        return f"Material({', '.join(f'{name}={value}' for name, value in values.items())})"


def texels(name: str, image: Any, signed: bool = False) -> Texture:
    """An image as a read-only (h, w, 3) array of uint8 or uint16; see `Material`. ValueError begins with the name.

    signed: whether int16 is allowed, too. An array that is just that, and owns its memory, is taken as it is.
    """
    mode = getattr(image, "mode", None)
    if isinstance(mode, str) and mode not in ("L", "RGB", "RGBA") and not mode.startswith("I;16"):
        raise ValueError(f"{name}: must have the mode L, RGB, RGBA or I;16, got {mode}; convert('RGB') makes it one")
    array = np.asarray(image)
    # Of either order of bytes: 16-bit images come in both.
    kinds = (np.uint8, np.uint16, np.int16) if signed else (np.uint8, np.uint16)
    if array.dtype.newbyteorder("=") not in kinds or is_masked(image):
        raise ValueError(f"{name}: must be an array of uint8 or uint16, got {described(image)}")
    if array.ndim not in (2, 3) or array.shape[2:] not in ((), (3,), (4,)):
        raise ValueError(f"{name}: must have shape (h, w, 3), (h, w, 4) or (h, w), got {array.shape}")
    if not 0 < array.shape[0] * array.shape[1] <= MAX_TEXELS:
        raise ValueError(f"{name}: must have 1 to {MAX_TEXELS} pixels, got {array.shape[0]} x {array.shape[1]}")
    own = array.base is None and not array.flags.writeable and array.flags.c_contiguous and array.dtype.isnative
    if not own or array.shape[2:] != (3,):
        rgb = np.empty((*array.shape[:2], 3), array.dtype.newbyteorder("="))
        rgb[:] = array[:, :, None] if array.ndim == 2 else array[:, :, :3]
        array = rgb
        array.flags.writeable = False
    return array


def checked_textures(textures: object) -> tuple[Texture, ...]:
    """The textures of a scene. Raises ValueError and TypeError, which name the index."""
    if not isinstance(textures, Iterable):
        raise TypeError(f"textures: must be a list of arrays, got {described(textures)}")
    found = tuple(texels(f"textures[{i}]", image, signed=True) for i, image in enumerate(textures))
    check_texels(found)
    return found


def check_texels(textures: Iterable[Texture]) -> None:
    """Raises ValueError if these are too many pixels for a scene."""
    count = sum(texture.shape[0] * texture.shape[1] for texture in textures)
    if count > MAX_TEXELS:
        raise ValueError(f"textures: must be at most {MAX_TEXELS} pixels in all, got {count}")


def records(materials: Iterable[Material]) -> tuple[NDArray[np.void], tuple[Texture, ...]]:
    """(n,) MATERIAL and the textures, each of which is one however many materials share it."""
    found = list(materials)
    textures = {id(m.texture): m.texture for m in found if m.texture is not None}
    place = {key: i for i, key in enumerate(textures)}
    result = np.empty(len(found), MATERIAL)
    for record, m in zip(result, found, strict=True):
        for name in (*COEFFICIENTS, "color", "index"):
            record[name] = getattr(m, name)
        record["texture"] = place.get(id(m.texture), -1)
    return result, tuple(textures.values())


def linear_texels(image: Texture, transfer: Transfer) -> Texture:
    """A texture whose numbers are linear: of sRGB 16 bits each, read-only."""
    if transfer == "linear" or image.dtype == np.int16:
        return image
    full = FULL[image.dtype]
    table = np.rint(decoded(np.arange(full + 1) / full, transfer) * 65535).astype(np.uint16)
    linear: Texture = table[image]
    linear.flags.writeable = False
    return linear


def check_materials(materials: NDArray[np.void], textures: int) -> None:
    """Raises ValueError, which names field and index, where a MATERIAL array holds what is not allowed.

    textures: how many there are.
    """
    of = materials["texture"]
    check_none("materials.texture", (of < -1) | (of >= textures), "-1 or the index of one of textures", of)
    for name in (*COEFFICIENTS, "color"):
        check_rule(f"materials.{name}", NOT_NEGATIVE, materials[name])
    check_index("materials.index", materials["index"], materials["transmittance"])


def check_index(name: str, index: NDArray[np.float64], transmittance: NDArray[np.float64]) -> None:
    """Raises ValueError, which names the array and the place, where light is let through with an index <= 0.

    Either may be one number for all.
    """
    check_rule(name, ANY, index)
    index, transmittance = np.broadcast_arrays(index, transmittance)
    bad = np.argwhere((index <= 0) & (transmittance > 0))
    if len(bad):
        where = tuple(bad[0])
        place = "".join(f"[{i}]" for i in where)
        raise ValueError(f"{name}{place}: must be > 0 where transmittance > 0, got {index[where]:g}")


def packed(count: int, columns: Mapping[str, ArrayLike]) -> NDArray[np.void]:
    """A (count,) MATERIAL array; each field has a value for each record or one for all. Without textures."""
    materials = np.empty(count, MATERIAL)
    materials["texture"] = -1
    for name, value in columns.items():
        materials[name] = value
    return materials
