"""VTK, which rasters: spheres as impostors, triangles with a light for each pixel, and no shadows."""

from __future__ import annotations

import importlib
import math
import os
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cltrace.base.arrays import processors
from cltrace.bench.tracers import OTHER_LIGHTS, Run, Tracer, strange
from cltrace.scene import Scene

from .peer import Company, Floats, in_turn, levels, lights, seen_from_the_eye, triangles, version_of

# Rays across a pixel, so to speak, and the samples that Mesa's rasterizer has for them.
MULTISAMPLES = {1: 0, 2: 4}


class Vtk(Tracer):
    """kernel: a picture drawn and read back; whole: with what it is given."""

    name = "VTK (no shadows)"

    def __init__(self, company: Company, version: str, level: int | None = None) -> None:
        self._company, self.version = company, version
        if level:
            self.task, self.level, self.variant = "samples", level, "multisampling"

    def refuses(self, scene: Scene) -> tuple[str, ...]:
        found = strange(scene, "cylinders", "ellipsoids", "textures", "mirrors", "glass",
                        OTHER_LIGHTS,
                        "materials that differ in more than colour")  # fmt: skip
        x, y = scene.camera.image_plane()
        width, height = scene.camera.resolution
        return found or (() if math.isclose(x * height, y * width) else ("pixels that are not square",))

    def run(self, scene: Scene, frames: int) -> Run:
        return self._company.run(scene, frames, MULTISAMPLES[int(self.level or 1)])


def draw(scene: Scene, frames: int, samples: int) -> Run:
    """In the process that the package has of its own."""
    os.environ.setdefault("LP_NUM_THREADS", str(processors()))
    vtk, support = (importlib.import_module(name) for name in ("vtk", "vtkmodules.util.numpy_support"))
    start = time.perf_counter()
    window = _window(vtk, support, scene, samples)
    width, height = scene.camera.resolution
    pixels = vtk.vtkUnsignedCharArray()

    def frame() -> NDArray[Any]:
        window.Render()
        window.GetPixelData(0, 0, width - 1, height - 1, 0, pixels, 0)
        shown: NDArray[Any] = support.vtk_to_numpy(pixels)
        return shown

    kernel, whole, shown = in_turn(frame, frames, start)
    rgb8 = shown.reshape(height, width, 3)[::-1].copy()
    window.Finalize()
    return Run(kernel, whole, rgb8)


def _window(vtk: Any, support: Any, scene: Scene, samples: int) -> Any:
    window, renderer, camera = vtk.vtkRenderWindow(), vtk.vtkRenderer(), vtk.vtkCamera()
    window.SetOffScreenRendering(1)
    window.SetMultiSamples(samples)
    window.SetSize(*scene.camera.resolution)
    window.AddRenderer(renderer)
    ambient, others = lights(scene)
    renderer.SetBackground(*scene.background)
    renderer.AutomaticLightCreationOff()
    for given in others:
        light = vtk.vtkLight()
        light.SetLightTypeToSceneLight()
        light.SetColor(*given.color)
        light.SetPositional(not given.parallel)
        light.SetConeAngle(180)
        light.SetPosition(*given.place)
        light.SetFocalPoint(0, 0, 0)
        renderer.AddLight(light)
    camera.SetPosition(0, 0, 0)
    camera.SetFocalPoint(0, 0, -1)
    camera.SetViewUp(0, 1, 0)
    half = scene.camera.image_plane()[1]
    if scene.camera.parallel:
        camera.ParallelProjectionOn()
        camera.SetParallelScale(half)
    else:
        camera.SetViewAngle(2 * math.degrees(math.atan(half)))
    renderer.SetActiveCamera(camera)
    for mapper in _mappers(vtk, support, scene):
        actor = vtk.vtkActor()
        actor.SetMapper(mapper)
        surface = actor.GetProperty()
        look = scene.materials[0]  # as the others are, but for the colour
        surface.SetAmbient(float(look["ka"] * ambient.mean()))
        surface.SetDiffuse(float(look["kd"]))
        surface.SetSpecular(float(look["ks"]))
        surface.SetSpecularPower(float(look["exponent"]))
        renderer.AddActor(actor)
    renderer.ResetCameraClippingRange()
    return window


def _mappers(vtk: Any, support: Any, scene: Scene) -> Iterable[Any]:
    colors = scene.materials["color"]
    if len(scene.spheres):
        mapper = vtk.vtkOpenGLSphereMapper()
        centers = seen_from_the_eye(scene, scene.spheres["center"])
        data = _data(vtk, support, centers, colors[scene.spheres["material"]])
        data.SetVerts(_cells(vtk, support, 1, len(centers)))
        radii = support.numpy_to_vtk(scene.spheres["radius"].astype("f4"), deep=True)
        radii.SetName("radius")
        data.GetPointData().AddArray(radii)
        mapper.SetInputData(data)
        mapper.SetScaleArray("radius")
        yield mapper
    if scene.meshes:
        mesh = triangles(scene)
        places, normals = (array.reshape(-1, 3) for array in mesh.smooth())
        data = _data(vtk, support, places, np.repeat(colors[mesh.material], 3, axis=0))
        data.GetPointData().SetNormals(support.numpy_to_vtk(normals.astype("f4"), deep=True))
        data.SetPolys(_cells(vtk, support, 3, len(places)))
        mapper = vtk.vtkPolyDataMapper()
        mapper.SetInputData(data)
        yield mapper


def _data(vtk: Any, support: Any, places: Floats, colors: NDArray[Any]) -> Any:
    """Points (n, 3) with colours, which VTK has in bytes."""
    data, points = vtk.vtkPolyData(), vtk.vtkPoints()
    points.SetData(support.numpy_to_vtk(places.astype("f4"), deep=True))
    data.SetPoints(points)
    data.GetPointData().SetScalars(support.numpy_to_vtk(levels(colors), deep=True))
    return data


def _cells(vtk: Any, support: Any, corners: int, points: int) -> Any:
    """All points, so many at a time."""
    cells = vtk.vtkCellArray()
    cells.SetData(corners, support.numpy_to_vtkIdTypeArray(np.arange(points, dtype=np.int64), deep=True))
    return cells


def tracers(folder: Path) -> Iterable[Tracer]:
    """VTK, if it is installed."""
    version, company = version_of("vtk"), Company(draw)
    return [Vtk(company, version), *(Vtk(company, version, level) for level in MULTISAMPLES)]
