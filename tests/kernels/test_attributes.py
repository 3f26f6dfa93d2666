"""What corners of triangles have, normals and texture coordinates, and what the kernel finds between them."""

from __future__ import annotations

import warnings

import numpy as np
import pyopencl as cl
import pytest

from cltrace.plan import abi, opencl
from cltrace.plan.shapes.mesh import CornerAttributes, PackedTriangles
from cltrace.run import program
from cltrace.run.devices import Device
from cltrace.scene import Geometry, PlacedMesh

pytestmark = pytest.mark.slow

# The kernel's files up to the one that is tested.
FILES = program.SOURCES[: program.SOURCES.index("shapes/triangle/surface.cl") + 1]
POINTS = 256
BODY = """
    __kernel void called(__global const int *which, __global const real *given, __global const real4 *vertex,
                         __global const int4 *face,
                         __global const Mesh *mesh, __global const real4 *normal,
                         __global const int4 *normal_face, __global const real2 *uv, __global const int4 *uv_face,
                         __global real *out) {
        const int first = (int)get_global_id(0) * W;
        Scene scene;
        scene.geometry.vertex = vertex;
        scene.geometry.face = face;
        scene.mesh = mesh;
        scene.corner_normal = normal;
        scene.normal_face = normal_face;
        scene.corner_uv = uv;
        scene.uv_face = uv_face;
        #define GIVEN(k) LOAD_LANES(given + k * POINTS + first)
        const INT number = LOAD_LANES(which + first);
        const Weights weights = {GIVEN(0), GIVEN(1), GIVEN(2)};
        const Real3 m = shading_normals(&scene, number, weights);
        Intersection at;
        at.u = at.v = -7;
        map_triangles(&scene, number, weights, &at);
        STORE_LANES(m.x, out + first);
        STORE_LANES(m.y, out + POINTS + first);
        STORE_LANES(m.z, out + 2 * POINTS + first);
        STORE_LANES(at.u, out + 3 * POINTS + first);
        STORE_LANES(at.v, out + 4 * POINTS + first);
    }"""


def geometry(random: np.random.Generator, faces: int, normals: int, uvs: int, holes: bool) -> Geometry:
    """Any triangles; with holes, some have no normals and some no texture coordinates."""
    of = [random.integers(0, n, (faces, 3)) if n else np.full((faces, 3), -1) for n in (normals, uvs)]
    if holes:
        of[0][::3] = of[1][1::3] = -1
    rows = [random.normal(size=(n, width)) for n, width in ((9, 3), (normals, 3), (uvs, 2))]
    return Geometry(rows[0], random.integers(0, 9, (faces, 3)), 37 * rows[1], of[0], rows[2], of[1])


def placed(random: np.random.Generator) -> tuple[PlacedMesh, ...]:
    """Four meshes; the first and the third have one geometry, the last one has no normals and the second no uv."""
    one = geometry(random, 7, 5, 4, False)
    shapes = one, geometry(random, 11, 6, 0, True), one, geometry(random, 5, 0, 6, True)
    return tuple(PlacedMesh(shape, random.normal(size=(3, 4)), 0, i) for i, shape in enumerate(shapes))


def test_what_meshes_share_is_there_once() -> None:
    meshes = placed(np.random.default_rng(0))
    triangles = PackedTriangles.of(meshes, False, once=False)
    at = CornerAttributes.of(meshes, triangles, "accurate", True)
    assert (at.corner_normal.shape, at.corner_uv.shape) == ((11, 4), (10, 2))
    assert at.normal_face.shape == at.uv_face.shape == (30, 4)
    assert np.array_equal(at.normal_face[:7, :3], at.normal_face[18:25, :3])
    assert at.normal_face[:, 3].tolist() == [0] * 7 + [-1, 1, 1] * 3 + [-1, 1] + [2] * 7 + [-1] * 5
    assert at.uv_face[:, 3].tolist() == [0] * 7 + [-1] * 11 + [2] * 7 + [3, -1, 3, 3, -1]
    assert np.array_equal(at.corner_normal[:5, :3], meshes[0].geometry.normals)
    assert 0.5 <= np.abs(CornerAttributes.of(meshes, triangles, "single", True).corner_normal[:5]).max() < 1
    bare = CornerAttributes.of(meshes, triangles, "accurate", False)
    assert len(bare.corner_uv) == len(bare.uv_face) == 0


@pytest.mark.parametrize(("precision", "bound"), [("accurate", 2.0**-51), ("single", 2.0**-21)])
def test_what_is_between_corners(device: Device, precision: abi.Precision, bound: float) -> None:
    random = np.random.default_rng(1)
    meshes = placed(random)
    faces = [len(mesh.geometry.faces) for mesh in meshes]
    mesh_of, number_of = np.repeat(range(4), faces), np.concatenate([np.arange(n, dtype=np.int32) for n in faces])
    order = random.permutation(sum(faces))
    mesh_of, number_of = mesh_of[order], number_of[order]
    which = random.integers(-1, sum(faces), POINTS).astype(np.int32)
    weights, corners = random.dirichlet((1, 1, 1), POINTS), random.normal(size=(sum(faces), 3, 3))
    N = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    want = np.empty((POINTS, 5))
    for i, t in enumerate(which):
        m, uv = N[t], [-7.0, -7.0] if t < 0 else [0.0, 0.0]
        if t >= 0:
            mesh, k = meshes[mesh_of[t]], number_of[t]
            shape = mesh.geometry
            if shape.normal_of[k, 0] >= 0:
                m = mesh.normal_to_world @ (weights[i] @ shape.normals[shape.normal_of[k]])
            if shape.uv_of[k, 0] >= 0:
                uv = (weights[i] @ shape.uv[shape.uv_of[k]]).tolist()
        want[i] = *(m / np.linalg.norm(m)), *uv

    real = abi.real_dtype(precision)
    face = np.arange(4 * sum(faces), dtype=np.int32).reshape(-1, 4)
    vertex = np.zeros((4 * len(corners), 4))
    vertex.reshape(-1, 4, 4)[:, :3, :3] = corners
    face[:, 3] = 2 * mesh_of + random.integers(0, 2, len(mesh_of))
    triangles = PackedTriangles(vertex, face, number_of, mesh_of, mesh_of)
    at = CornerAttributes.of(meshes, triangles, precision, True)
    arrays = which, weights.T.astype(real), vertex.astype(real), face, *at.arrays().values()
    features = frozenset(
        {
            "WITH_TRIANGLES",
            "WITH_SHAPES",
            "WITH_PLACED",
            "WITH_LEAVING",
            "WITH_INTERSECTION",
            "WITH_NORMAL",
            "WITH_UV",
            "OUT_PRIMITIVE",
        }
    )
    context = cl.Context([device.cl])
    queue, flags = cl.CommandQueue(context), cl.mem_flags
    for width in (w for w in (1, 4, 8, 16) if w <= device.width):
        options = [
            *opencl.options(precision, features),
            f"-DW={width}",
            "-DRUN=1",
            f"-DPOINTS={POINTS}",
            "-cl-std=CL1.2",
        ]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", cl.CompilerWarning)  # the log of a build that worked
            program_ = cl.Program(context, program.source(FILES) + BODY).build(options)
        read = flags.READ_ONLY | flags.COPY_HOST_PTR
        buffers = [cl.Buffer(context, read, hostbuf=np.ascontiguousarray(array)) for array in arrays]
        out = np.empty((5, POINTS), real)
        buffers.append(cl.Buffer(context, flags.WRITE_ONLY, out.nbytes))
        cl.Kernel(program_, "called")(queue, (POINTS // width,), (1,), *buffers)
        cl.enqueue_copy(queue, out, buffers[-1])
        m = out[:3].T.astype(np.float64)[which >= 0]
        # Normals may nearly cancel: of these, up to five bits are lost.
        assert np.abs(m / np.linalg.norm(m, axis=1, keepdims=True) - want[which >= 0, :3]).max() <= 32 * bound
        assert np.abs(out[3:5].T - want[:, 3:]).max() <= bound
