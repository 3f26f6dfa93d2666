"""How much a scene, its files and a picture may have. docs/format.md has what users meet.

Scenes and files may come from strangers, so whatever has a size is compared with its limit before memory is taken for
it, and the fault says the limit. What a limit is for stands beside it, where it is not the memory.
"""

# Of a picture. The kernel numbers pixels by an int, and the lists of a larger one would take more than 1 GB.
MAX_SIDE, MAX_PIXELS = 65_536, 2**30
MAX_BOUNCES = 100
MAX_RAYS = 2**20  # of a pixel, which takes more than a second then

# A light has tables of its own for all spheres, and is asked for at each point: more would be no scene but a trap. Each
# member of a soft light counts.
MAX_LIGHTS = 1024
MAX_SPHERES = 2**26
MAX_CYLINDERS = 2**24
# In all meshes of a scene. A mesh that is placed twice counts twice.
MAX_TRIANGLES = MAX_VERTICES = 2**26
MAX_MESHES = 2**16
# Triangles of files that a scene names again, where nobody allows more by --instances: a few bytes ask for them, and to
# draw one takes about 600 bytes at the peak.
INSTANCES = 2**21
MAX_TEXELS = 2**27  # in all textures of a scene
MAX_IMAGES = 10_000  # of a periodic box, among which the nearest is looked for

SCENE_BYTES = TEXTURE_BYTES = 2**30
MESH_BYTES = 2**32
# Of one sphere, mesh, light or other element, which is kept until it is complete. libxml2 has a limit for how deep
# elements are in each other: 256.
MAX_PARTS = 100_000
# Prefixes of namespaces in a file, and characters of a namespace. libxml2 compares each prefix of an element with all
# others, and every name in a namespace repeats it.
MAX_PREFIXES, MAX_NAMESPACE = 100, 250
MAX_FAULTS = 100_000  # of a mesh's file, after which no more of it is read
MAX_UNREADABLE = 1000  # files, after which no more are looked for

MAX_ROWS = 2**31 - 1  # of a buffer on a device, such as the entries of lists
# Bytes of addresses that the command needs, for libraries that end the process where there are less: `ulimit -v`.
ADDRESSES = 950_000 * 1024
