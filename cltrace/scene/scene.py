"""The scene: a camera, lights, packed arrays of spheres and materials, meshes, textures. No files, no devices.

Lengths are in scene units, angles in degrees, colours linear (1 = full). The world is right-handed with y up.
Every array is double precision, one record per object, and read-only.
"""

from __future__ import annotations

import functools
from collections.abc import Iterable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, fields
from itertools import accumulate
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cltrace.base.limits import MAX_CYLINDERS
from cltrace.scene.camera import AnyCamera, Camera, Orthographic
from cltrace.scene.clipping import Planes, clipped
from cltrace.scene.colormaps import Scale, colors_given
from cltrace.scene.colors import Transfer, background_of, check_transfer, decoded
from cltrace.scene.cylinders import Bonds, Cylinders, bonds_of, cylinders_of
from cltrace.scene.lights import check_lights, joined, lamps_of, setting
from cltrace.scene.materials import MATERIAL, Frozen, Material, Texture, check_materials, checked_textures
from cltrace.scene.meshes import Mesh, Meshes, PlacedMesh, placed_meshes
from cltrace.scene.rules import ANY, POSITIVE, Vector, checked, described, records_of
from cltrace.scene.spheres import SPHERE, Columns, Spheres, check_spheres, column, points, shades, shaped
from cltrace.scene.surfaces import NumberedSurfaces, Surfaces, fields_of

Lights = Iterable[NDArray[np.void]] | NDArray[np.void]
# The surfaces beside the spheres, in the order in which they are numbered, after these. Cylinders are last, as their
# number changes where bonds follow the spheres.
OTHERS: tuple[type[NumberedSurfaces], ...] = (Meshes, Planes, Cylinders)
OTHER_FIELDS = tuple(f.name for row in OTHERS for f in fields(row))  # of Scene


class MeshFile(NamedTuple):
    """The file of a mesh: its name, as the scene has it, and (f,) int32, the line of each triangle's face."""

    name: str
    lines: NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class Source:
    """The file of a scene, and the lines of what it holds: 1 is the first.

    path: the file's name, as it was given; view: the camera of the file; camera: the line of <camera>; lights: (n,)
    int32, of each light; surfaces: (m,) int32, of each surface, by its number; meshes: the files of the meshes, by the
    numbers of these surfaces; textures: the files of the textures, in their order; transforms: (k, 3, 4), the affine
    maps of the k steps of a surface's transform, in the order of the file, by the surface's number: of the first
    surfaces that have one; files: what the scene is made of: its own file, and those of its meshes and textures.
    """

    path: str
    view: Camera
    camera: int
    lights: NDArray[np.int32]
    surfaces: NDArray[np.int32]
    meshes: Mapping[int, MeshFile] = field(default_factory=dict)
    textures: tuple[str, ...] = ()
    transforms: Mapping[int, NDArray[np.float64]] = field(default_factory=dict)
    files: tuple[Path, ...] = ()


@dataclass(frozen=True, eq=False, init=False, repr=False)
class Scene(Frozen):
    """Everything that a picture depends on. Immutable and picklable.

    `Scene.from_spheres` and `Scene.from_meshes` make one of plain arrays.

    camera: a Camera or an Orthographic, which does as well wherever a Camera is asked for; lights: one (n,) LIGHT array
    or several, such as point_light() returns; spheres, materials: (n,) arrays of the dtypes SPHERE and MATERIAL of
    cltrace.scene; background: the linear colour of rays that hit nothing, 3 numbers >= 0; background_alpha: how much of
    it the picture shows, from 0, nothing, to 1; a fourth number of background is the same; output_file: the picture's
    name, without a folder; to_object: (k, 3, 3), the linear maps of the ellipsoids from the world to their own axes, of
    which a sphere's `to_object` is the index; meshes: of PlacedMesh, by rising numbers; textures: (h, w, 3) arrays of
    uint8 or uint16, or as Mesh makes them of colours int16, of which a material's `texture` is the index. The arrays
    are copied, but for textures that are read-only and own their memory.

    transfer: how the picture's colours become bytes, "linear" or "srgb", see from_spheres(). The colours here are
    linear with either.

    cylinders: an (n,) array of the dtype CYLINDER, with flat ends; bonds: what moves the first ones of them with the
    spheres, None for none; planes: a (k,) array of the dtype PLANE, which clip the scene, see clipped().

    All surfaces are numbered together, from 0, in the order of the file: that is a surface's id in a picture. Meshes
    and cylinders know their numbers, and the spheres have those that these leave.

    columns: what spheres and materials hold, as arrays, of which these records are made where they are asked for;
    source: the lines of the file that it was read from, a cltrace.scene.Source; scale: how the values of spheres become
    colours. Both are None of a scene that is made otherwise, as dataclasses.replace() does.

    Raises ValueError, which names the field and the index, where a value is not allowed, and TypeError where an
    argument is something else altogether.
    """

    camera: AnyCamera
    lights: NDArray[np.void]
    spheres: NDArray[np.void]
    materials: NDArray[np.void]
    background: Vector
    output_file: str
    to_object: NDArray[np.float64]
    meshes: tuple[PlacedMesh, ...]
    textures: tuple[Texture, ...]
    background_alpha: float
    transfer: Transfer
    cylinders: NDArray[np.void]
    bonds: Bonds | None
    planes: NDArray[np.void]
    columns: Columns = field(init=False)
    source: Source | None = field(default=None, init=False)
    scale: Scale | None = field(default=None, init=False)

    def __init__(
        self,
        camera: AnyCamera,
        lights: Lights,
        spheres: NDArray[np.void],
        materials: NDArray[np.void],
        background: ArrayLike = (0.0, 0.0, 0.0),
        output_file: str = "scene.png",
        to_object: ArrayLike = (),
        meshes: Iterable[PlacedMesh] = (),
        textures: Iterable[Texture] = (),
        background_alpha: float = 1.0,
        transfer: Transfer = "linear",
        cylinders: NDArray[np.void] | None = None,
        bonds: Bonds | None = None,
        planes: NDArray[np.void] | None = None,
    ) -> None:
        _check_camera(camera, "camera, lights, spheres, materials")
        balls, shades = records_of("spheres", spheres, SPHERE), records_of("materials", materials, MATERIAL)
        maps, images = checked("to_object", ANY, to_object, (-1, 3, 3)), checked_textures(textures)
        check_spheres(balls, len(shades), maps)
        check_materials(shades, len(images))
        check_transfer(transfer)
        given = {"meshes": meshes, "cylinders": cylinders, "bonds": bonds, "planes": planes}
        others = [row.checked(given, len(shades), len(balls)) for row in OTHERS]
        _check_numbers(others)
        color, alpha = background_of(background, background_alpha)
        if not isinstance(output_file, str):
            raise TypeError(f"output_file: must be a text, got {described(output_file)}")
        lamps = joined(lights)
        check_lights(lamps)
        state: dict[str, Any] = {"camera": camera, "lights": lamps, "output_file": output_file, "transfer": transfer}
        state |= {"background": color, "background_alpha": alpha, "columns": Columns.of_records(balls, shades)}
        state |= fields_of(others) | {"to_object": maps, "textures": images}
        self.__setstate__(state | {"scale": None, "source": None})

    def seen_by(self, camera: AnyCamera) -> Scene:
        """The same scene with another camera. It shares the arrays, so this takes no time however many spheres it has.

        dataclasses.replace() gives the same, but copies and checks everything anew.
        """
        _check_camera(camera)
        return self.changed(camera=camera)

    def in_front_of(self, background: ArrayLike) -> Scene:
        """The same scene in front of another background, 3 numbers or with an alpha 4. It shares the arrays.

        Like those of from_spheres(), its colour is by the scene's transfer curve.
        """
        color, alpha = background_of(background, 1.0, self.transfer)
        return self.changed(background=color, background_alpha=alpha)

    def lit_by(self, lights: Lights | str) -> Scene:
        """The same scene in other lights, those of a list or of a setting: see from_spheres(). It shares the arrays.

        Raises what from_spheres() raises.
        """
        if isinstance(lights, str):
            lights = setting(lights, self)
        found = joined(lights)
        check_lights(found)
        return self.with_fields(lights=found)

    @functools.cached_property
    def lamps(self) -> NDArray[np.void]:
        """(m,): the lights, each soft one as its members."""
        return lamps_of(self.lights)[0]

    @property
    def lamp_of(self) -> NDArray[np.intp]:
        """(m,): the index in `lights` of the light that each of `lamps` is or belongs to."""
        return lamps_of(self.lights)[1]

    def with_fields(self, **changes: object) -> Scene:
        """The same scene with other fields, which are taken as they are. `columns` is that of spheres and materials."""
        made = copy(self)  # without what has been worked out from the fields
        made.__setstate__({"source": None} | changes)
        return made

    @property
    def shapes(self) -> tuple[Surfaces, ...]:
        """All surfaces, by their shapes, the spheres first."""
        return (Spheres(self.columns, self.to_object), *self.others)

    @property
    def others(self) -> tuple[NumberedSurfaces, ...]:
        """Those beside the spheres, of each row of OTHERS."""
        return tuple(row(*(getattr(self, f.name) for f in fields(row))) for row in OTHERS)

    def __repr__(self) -> str:
        width, height = self.camera.resolution
        spheres, *others = self.shapes
        parts = [spheres, *(shape for shape in reversed(others) if len(shape)), f"{len(self.lights)} lights"]
        return f"<cltrace.Scene {width}x{height}: {', '.join(map(str, parts))}>"

    @property
    def triangles(self) -> int:
        """How many triangles the meshes have together."""
        return Meshes(self.meshes).triangles

    @functools.cached_property
    def sphere_numbers(self) -> NDArray[np.int32]:
        """(n,): the number of each sphere among all surfaces, rising."""
        taken = np.concatenate([shape.numbers for shape in self.others])
        free = np.setdiff1d(np.arange(len(self.columns) + len(taken)), taken, assume_unique=True)
        numbers = free[: len(self.columns)].astype(np.int32)
        numbers.flags.writeable = False
        return numbers

    @property
    def wholes(self) -> NDArray[np.int32]:
        """(n + 1,): of all surfaces, the number of the one whose other half each is, or its own; at the end -1."""
        taken = np.concatenate([shape.numbers for shape in self.others])
        found = np.arange(1 + max(len(self.columns) + len(taken), int(taken.max(initial=-1)) + 1), dtype=np.int32)
        found[taken], found[-1] = np.concatenate([shape.wholes for shape in self.others]), -1
        return found

    def following(self) -> Scene:
        """The same scene where what follows the spheres is where these are now."""
        first = sum(map(len, self.shapes[:-1]))
        return self.with_fields(**fields_of(shape.following(self.columns, first) for shape in self.others))

    def __getattr__(self, name: str) -> Any:
        """The records, which a scene has only if it is asked for them."""
        if name in ("spheres", "materials") and "columns" in vars(self):
            return getattr(self.columns, name)
        raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")

    def __getstate__(self) -> dict[str, Any]:
        return {name: vars(self)[name] for name in {f.name for f in fields(self)} - {"spheres", "materials"}}

    @classmethod
    def from_spheres(
        cls,
        camera: AnyCamera,
        lights: Lights | str,
        centers: ArrayLike,
        radii: ArrayLike,
        colors: ArrayLike | None = None,
        *,
        values: ArrayLike | None = None,
        cmap: Any = None,
        clim: ArrayLike | None = None,
        norm: Any = None,
        ka: ArrayLike | None = None,
        kd: ArrayLike = 0.8,
        ks: ArrayLike = 0.5,
        exponent: ArrayLike = 50.0,
        reflectance: ArrayLike = 0.0,
        transmittance: ArrayLike = 0.0,
        index: ArrayLike = 1.0,
        transform: ArrayLike | None = None,
        meshes: Iterable[Mesh] | Mesh = (),
        bonds: ArrayLike | None = None,
        bond_radius: ArrayLike | None = None,
        bond_colors: ArrayLike | None = None,
        box: ArrayLike | None = None,
        background: ArrayLike = (0.0, 0.0, 0.0),
        output_file: str = "scene.png",
        transfer: Transfer = "linear",
    ) -> Scene:
        """A scene of plain arrays.

        camera: a Camera; lights: a list of what ambient_light(), point_light(), sky_light() and the like return, or a
        setting by its name: "studio", "sky", "rim" or "flat", which is placed about the surfaces as the camera sees
        them; centers: (n, 3), or [] for no spheres, and radii: (n,) or one number, scene units; colors: (n, 3) or one
        colour, linear, 1 = full, white if there are none; background, output_file: see Scene. A colour may be a text:
        a name of CSS or #rrggbb, whose bytes are divided by 255, and colors may be a list of such. The background may
        have a fourth number, its alpha: with (r, g, b, 0) or "#rrggbb00" it is transparent.

        values: (n,) numbers that are shown as colours, instead of colors; cmap: the colour map, by its name in
        matplotlib, viridis if it is None, or a callable, or an array of colours; clim: (low, high), the values at its
        two ends, which values beyond have, too; the least and the largest value if it is None; norm: a function of the
        values, such as numpy.log, or a norm of matplotlib, such as LogNorm(). See Scale.of and map_of in
        cltrace.scene.colormaps, and cltrace.colorbar for the bar beside the picture. The scene remembers all three for
        values that come later, as of Renderer.update().

        ka, kd, ks: how strongly a surface shows ambient light, diffuse light and highlights; exponent: the larger, the
        smaller the highlight; each (n,) or one number >= 0. Without ka it is kd: ambient light stands for light that
        arrives from all around, and a matte surface returns as much of it as of light from one side. What no light
        reaches then shows kd times the ambient light, and with kd = 0.8 a surface that faces one white light beside
        the default ambient light shows exactly its colour.

        reflectance, transmittance: the shares of the light that a surface mirrors and lets through, each (n,) or one
        number >= 0; index: the index of refraction inside, (n,) or one number, > 0 where transmittance > 0; it is 1
        outside, about 1.5 for glass, and with 1 rays pass straight on.

        transform: a (3, 3) matrix for all or (n, 3, 3): a linear map of the world that is applied to each sphere about
        its centre, which makes it an ellipsoid. One that only rotates, mirrors and scales uniformly leaves a sphere.

        meshes: of cltrace.Mesh, whose numbers follow those of the spheres.

        bonds: (k, 2), pairs of indices of centers, between which cylinders are drawn; bond_radius: (k,) or one number,
        scene units. Where the ends differ in material, a bond is two cylinders that meet in the middle, each as its
        end. bond_colors: (k, 3) or one colour for whole bonds, or (k, 2, 3), one for each half; else they are as their
        ends. box: of a periodic simulation, its three lengths or a (3, 3) matrix of its edges as rows: a bond leads to
        the nearest image of its other end; across the box's boundary, it is drawn from both ends, half of the way. The
        numbers of bonds follow those of the meshes.

        transfer: "linear" for colours that are linear and become bytes without gamma, as the course has it; "srgb" for
        those that are given and written as sRGB, as other programs have it, while light adds up linearly between:
        colors, the map's, those of meshes' materials and their textures, and the background, but not the lights', which
        are amounts of light. Bytes that are given come back on unlit surfaces, with either.

        Raises ValueError, which names the argument and the index, TypeError as Scene does, and MissingPackageError if
        a map's name needs a package that is not there.
        """
        _check_camera(camera, "camera, lights, centers, radii, colors")
        none = np.zeros(0, SPHERE), np.zeros(0, MATERIAL)
        bare = cls(camera, (), *none, output_file=output_file, transfer=transfer).in_front_of(background)
        center = points(centers, radii)
        n = len(center)
        radius = column("radii", POSITIVE, radii, (n,))
        colors, scale = colors_given(n, colors, values=values, cmap=cmap, clim=clim, norm=norm)
        given = {"color": (1.0, 1.0, 1.0) if colors is None else colors, "kd": kd, "ks": ks, "exponent": exponent}
        given |= {"reflectance": reflectance, "transmittance": transmittance, "index": index}
        shade = shades(given if ka is None else {**given, "ka": ka}, n)
        if ka is None:
            shade["ka"] = shade["kd"]
        one = n > 0 and not any(values.ndim > (name == "color") for name, values in shade.items())
        count, material = (1, np.zeros((), np.int32)) if one else (n, None)
        radius, to_object, maps = shaped(radius, n, transform)
        shade["color"] = decoded(shade["color"], transfer)

        placed, more, textures = placed_meshes(meshes, transfer, count, n)
        columns = Columns(center, radius, material, to_object, shade=shade, count=count, rest=more, follows=ka is None)
        made = bare.with_fields(columns=columns, to_object=maps, meshes=placed, textures=textures, scale=scale)
        made = made.lit_by(lights)
        of = {"bonds": bonds, "bond_radius": bond_radius, "bond_colors": bond_colors, "box": box}
        columns, joining = bonds_of(columns, transfer, of)
        return made.with_fields(columns=columns, bonds=joining).following() if joining else made

    @classmethod
    def from_meshes(
        cls,
        camera: AnyCamera,
        lights: Lights | str,
        meshes: Iterable[Mesh] | Mesh,
        *,
        background: ArrayLike = (0.0, 0.0, 0.0),
        output_file: str = "scene.png",
        transfer: Transfer = "linear",
    ) -> Scene:
        """A scene of meshes; with spheres, too, from_spheres makes it.

        camera: a Camera; meshes: a cltrace.Mesh or several; background, output_file: see Scene; lights, transfer: see
        from_spheres().

        Raises ValueError and TypeError, which name the argument and the index.
        """
        _check_camera(camera, "camera, lights, meshes")
        return cls.from_spheres(
            camera, lights, (), 1.0, meshes=meshes, background=background, output_file=output_file, transfer=transfer
        )

    def with_cylinders(
        self,
        starts: ArrayLike,
        ends: ArrayLike,
        radius: ArrayLike,
        colors: ArrayLike | None = None,
        material: Material | None = None,
        clipped: bool = True,
    ) -> Scene:
        """The same scene with more cylinders, whose numbers follow those of all other surfaces. Their ends are flat;
        spheres of the same radius at the ends make them round.

        starts, ends: (n, 3), the middles of their ends, and radius: (n,) or one number, scene units; colors: (n, 3) or
        one colour, as of from_spheres(), or (n, 2, 3), one for each half: then each is two cylinders that meet in the
        middle; white without. material: a Material without texture, whose colour is that of `colors` if these are
        given; clipped: whether the planes of clipped() clip them. box_edges() and axes() give starts and ends.

        Raises ValueError, which names the argument and the index, and TypeError if material is none.
        """
        made, kinds = cylinders_of(starts, ends, radius, colors, material, self.transfer)
        made["material"] += self.columns.materials_count
        made["unclipped"] = not clipped
        found = np.concatenate([self.cylinders, made])
        found["number"][len(self.cylinders) :] = sum(map(len, self.shapes)) + np.arange(len(made))
        if len(found) > MAX_CYLINDERS:
            raise ValueError(f"cylinders: must be at most {MAX_CYLINDERS}, got {len(found)}")
        return self.with_fields(columns=self.columns.with_more(kinds), cylinders=found)

    def clipped(self, point: ArrayLike, normal: ArrayLike, cap_color: ArrayLike | None = None) -> Scene:
        """Clip the scene by a plane, so that one sees what is inside.

        Planes add up: what is drawn is on the kept side of all of them. Surfaces of all shapes are clipped, and keep
        their numbers and their places. Where a ray of the camera enters what the planes keep inside of a closed
        surface, a flat cap is drawn. It has the id of that surface, of several the one with the lowest number, and the
        `primitive` -2 - i, where i is the number of the plane. Spheres, ellipsoids, cylinders and meshes of which each
        edge belongs to an even number of triangles are closed. Surfaces that were added with ``clipped=False`` are not
        clipped.

        Parameters
        ----------
        point : array_like, shape (3,)
            A point of the plane, in scene units.
        normal : array_like, shape (3,)
            The direction across the plane to the side that is left out, of any length but 0.
        cap_color : colour, optional
            A colour, as of from_spheres(), of matte caps in this plane. By default, a cap has the material of the
            surface that it closes, without its texture.

        Returns
        -------
        Scene
            It shares all arrays with this one.

        Raises
        ------
        ValueError
            If an argument is not allowed, or if there are too many planes. The message names the argument.
        """
        return clipped(self, point, normal, cap_color)

    def replicate(self, offsets: ArrayLike) -> Scene:
        """The same scene with all surfaces once for each of k offsets, (k, 3), by which they are moved, scene units.

        box_images() gives those of a periodic box. Bonds of one with `box` are halves at its boundary, which meet those
        of the next image there. Surfaces are numbered anew: the spheres of each image in turn, then the meshes, the
        the cylinders; so sphere i of n has the number k n + i in image k. Camera and lights stay where
        they are.

        Raises ValueError, which names offsets and the index.
        """
        moves = checked("offsets", ANY, offsets, (-1, 3))
        for shape in self.shapes:
            if len(moves) * shape.counted > shape.most:
                most = f"must make at most {shape.most} {shape.words}"
                raise ValueError(f"offsets: {most}, got {len(moves)} times {shape.counted}")
        firsts = accumulate((len(moves) * len(shape) for shape in self.shapes), initial=0)
        made = [shape.moved(moves, k, len(self.columns)) for shape, k in zip(self.shapes, firsts, strict=False)]
        return self.with_fields(**fields_of(made)).following()


def _check_numbers(others: Sequence[NumberedSurfaces]) -> None:
    """Raises ValueError if a surface has a number that is taken."""
    found, counts = np.unique(np.concatenate([shape.numbers for shape in others]), return_counts=True)
    for number in found[counts > 1].tolist():
        last = next(shape for shape in reversed(others) if number in shape.numbers)
        raise ValueError(f"{last.words}.number: {number} is given twice")


def share_all_but_camera(old: Scene, new: Scene) -> bool:
    """Whether two scenes share all but the camera."""
    names = {f.name for f in fields(Scene)} - {"camera", "output_file", "source", "scale", "spheres", "materials"}
    return all(getattr(old, name) is getattr(new, name) for name in ("columns", *names))


def _check_camera(camera: object, order: str = "") -> None:
    """Raises TypeError, which says the order of the arguments, if this is no camera."""
    if not isinstance(camera, (Camera, Orthographic)):
        advice = f"; the order is {order}" if order else ""
        raise TypeError(f"camera: must be a cltrace.Camera or Orthographic, got {described(camera)}{advice}")
