"""What Embree 3 decides otherwise than exact arithmetic: `python tests/embree.py [--size N] [--seeds N] [REGIME ...]`.

Its library must be installed (Debian: libembree3-3). Embree computes in float32, so vertices, eyes and rays of each
regime of tests/hostile/mesh_regimes.py are rounded to float32 first, and both Embree and the oracle are asked about
these numbers; so is trace_rays, which must say what the oracle says. Prints how many rays, in Embree's robust mode and
in the other one,

    leak       meet nothing, and must meet something
    phantom    meet something, and must not
    far        meet another triangle than the first one, at another distance
    other      meet another triangle at that distance: a neighbour at an edge, or a second one in the same place
    odd        meet a closed mesh an odd number of times from outside, or an even one from within
"""

from __future__ import annotations

import argparse
import ctypes
from typing import NamedTuple

import numpy as np
from hostile.mesh_regimes import AROUND, CLOSED, REGIMES, scene_of
from hostile.sphere_regimes import rays as camera_rays
from numpy.typing import NDArray

from cltrace import Camera, Mesh, Scene, oracle
from cltrace.renderers.rays import trace_rays

Floats32 = NDArray[np.float32]

# embree3/rtcore_*.h
RAY = np.dtype(
    [
        ("origin", "f4", 3), ("near", "f4"), ("direction", "f4", 3), ("time", "f4"), ("far", "f4"), ("mask", "u4"),
        ("id", "u4"), ("flags", "u4"), ("normal", "f4", 3), ("uv", "f4", 2), ("primitive", "u4"), ("geometry", "u4"),
        ("instance", "u4"),
    ]
)  # fmt: skip
TRIANGLE, VERTEX, INDEX, FLOAT3, UINT3, ROBUST = 0, 1, 0, 0x9003, 0x5003, 4
NONE = 0xFFFFFFFF


class Arguments(ctypes.Structure):
    """Of a filter function."""

    _fields_ = (
        ("valid", ctypes.POINTER(ctypes.c_int)), ("user", ctypes.c_void_p), ("context", ctypes.c_void_p),
        ("ray", ctypes.POINTER(ctypes.c_uint)), ("hit", ctypes.c_void_p), ("n", ctypes.c_uint),
    )  # fmt: skip


FILTER = ctypes.CFUNCTYPE(None, ctypes.POINTER(Arguments))


class Rays(NamedTuple):
    vertices: Floats32
    faces: NDArray[np.uint32]
    origin: Floats32
    directions: Floats32


def library() -> ctypes.CDLL:
    lib = ctypes.CDLL("libembree3.so.3")
    for name in ("rtcNewDevice", "rtcNewScene", "rtcNewGeometry", "rtcSetNewGeometryBuffer"):
        getattr(lib, name).restype = ctypes.c_void_p
    lib.rtcGetDeviceProperty.restype = ctypes.c_ssize_t
    return lib


def traced(
    lib: ctypes.CDLL, rays: Rays, flags: int, near: float
) -> tuple[NDArray[np.int64], Floats32, NDArray[np.int64]]:
    """Of each ray: the triangle that it meets first, -1 for none, how far away, and how many it meets in all.

    near: what is nearer does not count. With 0 a triangle counts in whose plane the ray starts; with another number,
    none does where all of it is tiny.
    """
    pointer, device = ctypes.c_void_p, ctypes.c_void_p(lib.rtcNewDevice(None))
    scene = pointer(lib.rtcNewScene(device))
    mesh = pointer(lib.rtcNewGeometry(device, TRIANGLE))
    for kind, form, array in ((VERTEX, FLOAT3, rays.vertices), (INDEX, UINT3, rays.faces)):
        size = ctypes.c_size_t(array.strides[0])
        place = lib.rtcSetNewGeometryBuffer(mesh, kind, 0, form, size, ctypes.c_size_t(len(array)))
        ctypes.memmove(place, array.ctypes.data, array.nbytes)
    count = np.zeros(len(rays.directions), np.int64)

    @FILTER
    def counted(arguments: ctypes._Pointer[Arguments]) -> None:
        """Counts a hit, and takes it for none."""
        a = arguments.contents
        for i in range(a.n):
            if a.valid[i] == -1:
                count[a.ray[10 * a.n + i]] += 1
                a.valid[i] = 0

    lib.rtcSetSceneFlags(scene, flags)

    def shot() -> NDArray[np.void]:
        lib.rtcCommitGeometry(mesh)
        lib.rtcCommitScene(scene)
        memory = np.zeros(len(rays.directions) * RAY.itemsize + 16, np.uint8)
        table = memory[-memory.ctypes.data % 16 :][: len(rays.directions) * RAY.itemsize].view(RAY)
        table["origin"], table["direction"], table["far"], table["mask"] = rays.origin, rays.directions, np.inf, NONE
        table["id"], table["near"] = np.arange(len(table)), near
        table["primitive"] = table["geometry"] = table["instance"] = NONE
        context = np.zeros(16, np.uint32)
        context[4] = NONE
        for i in range(len(table)):
            lib.rtcIntersect1(scene, pointer(context.ctypes.data), pointer(table.ctypes.data + i * RAY.itemsize))
        return table

    lib.rtcAttachGeometry(scene, mesh)
    first = shot()
    lib.rtcSetGeometryIntersectFilterFunction(mesh, counted)
    shot()
    lib.rtcReleaseGeometry(mesh)
    lib.rtcReleaseScene(scene)
    lib.rtcReleaseDevice(device)
    return np.where(first["geometry"] == NONE, -1, first["primitive"].astype(np.int64)), first["far"].copy(), count


def quantized(scene: Scene) -> Rays:
    vertices = [mesh.vertices.astype(np.float32) for mesh in scene.meshes]
    first = np.cumsum([0, *map(len, vertices)])
    faces = [mesh.geometry.faces + k for mesh, k in zip(scene.meshes, first, strict=False)]
    d = camera_rays(scene.camera) @ np.array(scene.camera.basis())
    return Rays(
        np.ascontiguousarray(np.concatenate(vertices)),
        np.ascontiguousarray(np.concatenate(faces), np.uint32),
        np.array(scene.camera.position, np.float32),
        d.astype(np.float32),
    )


def judged(lib: ctypes.CDLL, name: str, seeds: int, size: int) -> NDArray[np.int64]:
    """(2, 6): of the robust mode and the other one, the rays, and those of each kind that the docstring above has."""
    out = np.zeros((2, 6), np.int64)
    for seed in range(seeds):
        rays = quantized(scene_of(name, seed, (size, size)))
        mesh = Mesh(rays.vertices, rays.faces)
        scene = Scene.from_meshes(Camera(), (), mesh)
        want = oracle.closest_hit(scene, rays.origin, rays.directions)
        hits = trace_rays(scene, rays.origin, rays.directions)
        assert (hits.primitive == want.primitive).all()
        assert (hits.t == want.t).all()
        for row, flags in enumerate((ROBUST, 0)):
            index, t, count = traced(lib, rays, flags, 2.0**-100 if name.startswith("eye") else 0.0)
            out[row, 0] += len(index)
            out[row, 1] += np.sum((index < 0) & (want.id >= 0))
            out[row, 2] += np.sum((index >= 0) & (want.id < 0))
            differs = (index >= 0) & (want.id >= 0) & (index != want.primitive)
            with np.errstate(invalid="ignore"):
                near = np.abs(t - want.t) <= 2.0**-18 * want.t
            out[row, 3] += np.sum(differs & ~near)
            out[row, 4] += np.sum(differs & near)
            if name in CLOSED or name in AROUND:
                right = oracle.triangles_met(rays.origin, rays.directions, rays.vertices, rays.faces) % 2
                out[row, 5] += np.sum(count % 2 != right)
    return out


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("regimes", nargs="*", metavar="REGIME", help="the first letters of some; all by default")
    parser.add_argument("--size", type=int, default=64, help="rays along each side of a picture, a power of two")
    parser.add_argument("--seeds", type=int, default=1)
    args = parser.parse_args()
    lib = library()
    device = ctypes.c_void_p(lib.rtcNewDevice(None))
    version = ".".join(str(lib.rtcGetDeviceProperty(device, i)) for i in (1, 2, 3))
    print(f"Embree {version}; robust / not\n")
    print("| regime | rays | leak | phantom | far | other | odd |\n|---|---|---|---|---|---|---|")
    total = np.zeros((2, 6), np.int64)
    for name in REGIMES:
        if args.regimes and not any(name.startswith(word) for word in args.regimes):
            continue
        found = judged(lib, name, args.seeds, args.size)
        total += found
        cells = [f"{x:,} / {y:,}" for x, y in found.T[1:]]
        if name not in CLOSED and name not in AROUND:
            cells[-1] = ""
        print(f"| {name} | {found[0, 0]:,} | {' | '.join(cells)} |", flush=True)
    print(f"| all | {total[0, 0]:,} | {' | '.join(f'{x:,} / {y:,}' for x, y in total.T[1:])} |")


if __name__ == "__main__":
    main()
