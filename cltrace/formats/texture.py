"""Reads a texture, a PNG or JPEG file, as an array of its pixels.

Values are taken as they are stored: gamma, colour profiles and the camera's orientation do not count, nor does alpha.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image, UnidentifiedImageError

from cltrace.base.errors import warnings_are
from cltrace.base.limits import MAX_TEXELS, hint
from cltrace.base.limits import TEXTURE_BYTES as MAX_BYTES
from cltrace.formats.files import UnreadableError, check_regular
from cltrace.scene import Texture

BAND = 2**16  # pixels that are converted at a time
_PNG, _DEPTH = b"\x89PNG", 24  # the first bytes of a PNG, and where its bits for each colour stand


def read_texture(path: str, most: int = MAX_TEXELS) -> tuple[Texture, str | None]:
    """The pixels of an image, (h, w, 3), uint8 or, of 16 bits of grey, uint16, read-only; and a warning or None.

    most: how many pixels it may have, which is asked before they are decoded. Raises UnreadableError with what is
    wrong, in words that belong behind the file's name.
    """
    check_regular(path)
    try:
        if Path(path).stat().st_size > MAX_BYTES:
            raise UnreadableError(f"must not be larger than {MAX_BYTES} bytes{hint('texture-bytes')}")
        # They are of many pixels, which are counted here, and of what pixels do not need.
        with warnings_are("ignore"), Path(path).open("rb") as file:
            head = file.read(_DEPTH + 1)
            file.seek(0)
            with Image.open(file, formats=("PNG", "JPEG")) as image:
                if image.width * image.height > most:
                    raise UnreadableError(_too_large(most))
                return _pixels(image, head)
    except (UnreadableError, MemoryError):
        raise
    except UnidentifiedImageError:
        raise UnreadableError("is no PNG or JPEG file") from None
    except Image.DecompressionBombError:
        raise UnreadableError(_too_large(most)) from None
    except Exception as error:  # decoders raise whatever their code does
        words = error.strerror if isinstance(error, OSError) else None
        raise UnreadableError(f"cannot be read: {words}" if words else "is damaged") from None


def _too_large(most: int) -> str:
    return f"must not have more than {most} pixels" + (" with the textures before it" if most < MAX_TEXELS else "")


def _pixels(image: Image.Image, head: bytes) -> tuple[Texture, str | None]:
    image.load()
    image.info.pop("transparency", None)
    grey = image.mode.startswith("I")  # of 16 bits, which convert() would clip at 255
    pixels = np.empty((image.height, image.width, 3), np.uint16 if grey else np.uint8)
    step = max(1, BAND // image.width)
    for y in range(0, image.height, step):  # a converted copy of all would take as much memory again
        rows = image.crop((0, y, image.width, min(y + step, image.height)))
        pixels[y : y + step] = np.asarray(rows)[..., None] if grey else np.asarray(rows.convert("RGB"))
    pixels.flags.writeable = False
    if grey:
        return pixels, None
    if image.mode == "CMYK":
        return pixels, "is CMYK, which is taken for RGB without a colour profile"
    if head.startswith(_PNG) and head[_DEPTH] == 16:
        return pixels, "has 16 bits for each colour, of which the upper 8 count"
    return pixels, None
