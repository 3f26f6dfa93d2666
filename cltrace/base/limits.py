"""How much a scene, its files and a picture may have. docs/format.md has what users meet.

Scenes and files may come from strangers, so whatever has a size is compared with its limit before memory is taken for
it, and the fault says the limit. What a limit is for stands beside it, where it is not the memory.

Other modules take these numbers when they are loaded. Until then, change() has others of them.
"""

import os
import re
import warnings
from collections.abc import Iterable

# Of a picture. The kernel numbers pixels by an int, and the lists of a larger one would take more than 1 GB.
MAX_SIDE, MAX_PIXELS = 65_536, 2**30
MAX_BOUNCES = 100
MAX_RAYS = 2**20  # of a pixel, which takes more than a second then
# Of drawing a picture, and of the lists for its second light and later ones. A small file can ask for hours, but only
# those who draw scenes from strangers know how long is too long.
MAX_SECONDS = 10**8

# A light has tables of its own for all spheres, and is asked for at each point: more would be no scene but a trap. Each
# member of a soft light counts.
MAX_LIGHTS = 1024
# Pairs of a light and a surface in a scene that is read from files, as each light has lists of all surfaces: these take
# up to 9 seconds of a processor and 1.8 GB. Files of more than PAIRS_BYTES in all may have more in proportion: what is
# large may take long. FEW lights shine on as many surfaces as files hold, if no mesh is placed again: a few bytes ask
# for that.
MAX_PAIRS, PAIRS_BYTES, FEW = 750_000, 2**20, 64
MAX_SPHERES = 2**26
MAX_CYLINDERS = 2**24
MAX_PLANES = 256  # that clip a scene: each ray asks all of them
# In all meshes of a scene. A mesh that is placed twice counts twice.
MAX_TRIANGLES = MAX_VERTICES = 2**26
MAX_MESHES = 2**16
# Triangles of files that a scene names again, where nobody allows more by a limit: a few bytes ask for them, and to
# draw one takes about 600 bytes at the peak, and up to 11 microseconds for the lists of each light.
INSTANCES = 2**18
MAX_TEXELS = 2**27  # in all textures of a scene
MAX_IMAGES = 10_000  # of a periodic box, among which the nearest is looked for
MAX_BOXES = 2**24  # side by side, of Scene.replicate()

SCENE_BYTES = TEXTURE_BYTES = 2**30
MESH_BYTES = 2**32
# libxml2 has limits of its own: elements are at most 256 deep in each other, and texts have at most 10 MB.
MAX_NAMES = 10_000  # of unknown elements and attributes, which the parser keeps
MAX_NAMESPACES = 100  # that a file declares: the parser compares the prefix of each element with all of them
MAX_STEPS = 100_000  # of a transform
MAX_FAULTS = 100_000  # of a mesh's file, after which no more of it is read
MAX_UNREADABLE = 1000  # files, after which no more are looked for

MAX_ROWS = 2**31 - 1  # of a buffer on a device, such as the entries of lists
# Bytes of addresses that the command needs, for libraries that end the process where there are less: `ulimit -v`.
ADDRESSES = 950_000 * 1024

# The limits by the names that users give them, and the most that each may be: where that is what it is already, other
# numbers rely on it. Lower ones are for scenes of strangers.
NAMES = {
    "lights": ("MAX_LIGHTS", 2**16),
    "spheres": ("MAX_SPHERES", MAX_SPHERES),
    "cylinders": ("MAX_CYLINDERS", MAX_CYLINDERS),
    "meshes": ("MAX_MESHES", MAX_MESHES),
    "triangles": ("MAX_TRIANGLES", MAX_TRIANGLES),
    "vertices": ("MAX_VERTICES", MAX_VERTICES),
    "instances": ("INSTANCES", MAX_TRIANGLES),
    "texels": ("MAX_TEXELS", MAX_TEXELS),
    "bounces": ("MAX_BOUNCES", MAX_BOUNCES),
    "rays": ("MAX_RAYS", 2**30),
    "pairs": ("MAX_PAIRS", 2**40),
    "seconds": ("MAX_SECONDS", MAX_SECONDS),
    "side": ("MAX_SIDE", MAX_SIDE),
    "pixels": ("MAX_PIXELS", MAX_PIXELS),
    "steps": ("MAX_STEPS", 2**26),
    "scene-bytes": ("SCENE_BYTES", 2**40),
    "mesh-bytes": ("MESH_BYTES", 2**40),
    "texture-bytes": ("TEXTURE_BYTES", 2**40),
}
# In the environment, for processes that this one starts: some NAME=VALUE with spaces between them.
CHANGED = "CLTRACE_LIMITS"


def limit_of(text: str) -> tuple[str, int]:
    """The name and the value of NAME=VALUE. Raises ValueError where one of them is not allowed."""
    name, _, value = text.partition("=")
    if name not in NAMES:
        raise ValueError(f"must be NAME=VALUE, with a name of {', '.join(NAMES)}, got {text!r}")
    most = NAMES[name][1]
    if not re.fullmatch("[0-9]{1,15}", value) or not 1 <= int(value) <= most:
        raise ValueError(f"{name} must be a whole number within 1..{most}, got {value!r}")
    return name, int(value)


def current(name: str) -> int:
    """The value that a name of NAMES has."""
    return int(globals()[NAMES[name][0]])


def hint(name: str) -> str:
    """The end of a message that a limit is passed: how to have more, or nothing where there cannot be more."""
    return f"; --limit {name}=N or {CHANGED} allows more" if current(name) < NAMES[name][1] else ""


def change(texts: Iterable[str]) -> None:
    """Sets limits, each NAME=VALUE, for modules that are loaded from now on.

    Raises ValueError with all that limit_of() does not allow; the others are set.
    """
    faults = []
    for text in texts:
        try:
            name, value = limit_of(text)
            globals()[NAMES[name][0]] = value
        except ValueError as error:
            faults.append(str(error))
    if faults:
        raise ValueError("; ".join(faults))


try:
    change(os.environ.get(CHANGED, "").split())
except ValueError as error:
    warnings.warn(f"{CHANGED}: {error}", stacklevel=1)
