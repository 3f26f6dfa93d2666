"""The Python interface: images, renderers, and what they refuse."""

from __future__ import annotations

import copy
import multiprocessing
import os
import pickle
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image as Picture
from random_scenes import usual_scene

import cltrace
from cltrace import Image, Renderer
from cltrace.run import executor
from cltrace.run.devices import Device

# As in tests/picture/test_outputs.py, which shares the program.
EVERY = ("rgb8", "color", "normal", "direction", "depth", "id", "primitive", "uv")


def test_only_what_was_asked_for(any_device: Device) -> None:
    image = cltrace.render(usual_scene(), any_device, outputs=("id", "depth"))
    assert image.outputs == ("depth", "id")
    for name, message in (
        ("rgb8", "the image has no rgb8, only depth, id; ask for it with outputs=('depth', 'id', 'rgb8')"),
        ("colour", "an Image has no attribute 'colour'"),
    ):
        with pytest.raises(AttributeError) as caught:
            getattr(image, name)
        assert str(caught.value) == message
    assert image.id.dtype == np.int32
    assert image.depth.dtype == np.float64
    every = cltrace.render(usual_scene(), any_device, outputs=EVERY)
    assert every.rgb8.dtype == np.uint8
    assert {a.dtype for a in (every.color, every.normal, every.direction)} == {np.dtype("f4")}
    assert {a.shape for a in (every.rgb8, every.color, every.normal, every.direction)} == {(33, 47, 3)}


def test_render_into_an_earlier_image(any_device: Device) -> None:
    renderer = Renderer(usual_scene(), any_device)
    first = renderer.render()
    kept = first.rgb8.copy()
    first.rgb8[:] = 0
    assert np.array_equal(renderer.render().rgb8, kept)  # which is another image
    assert np.array_equal(renderer.render(first).rgb8, kept)
    for other in (Renderer(usual_scene(), any_device), Renderer(usual_scene(), any_device, outputs=("rgb8", "id"))):
        with pytest.raises(ValueError, match=r"^out: must be an image that this Renderer has rendered$"):
            other.render(first)
    with pytest.raises(ValueError, match="out: "):
        renderer.render(Image())


def test_images_and_scenes_travel(any_device: Device) -> None:
    image = cltrace.render(usual_scene(), any_device)
    again = pickle.loads(pickle.dumps(image))
    assert np.array_equal(again.rgb8, image.rgb8)
    scene = pickle.loads(pickle.dumps(usual_scene()))
    with pytest.raises(ValueError, match="read-only"):
        scene.spheres["radius"][0] = -1
    assert np.array_equal(cltrace.render(scene, any_device).rgb8, image.rgb8)


def test_a_renderer_does_not_travel(any_device: Device) -> None:
    renderer = Renderer(usual_scene(), any_device)
    for how in (pickle.dumps, copy.deepcopy):
        with pytest.raises(TypeError, match=r"^a Renderer cannot be pickled, since .*: pickle its scene, and "):
            how(renderer)
    assert np.array_equal(copy.copy(renderer).render().rgb8, renderer.render().rgb8)
    count = len(renderer.scene.spheres)
    more = f"{count} spheres, {renderer.precision} precision, on {any_device.name}"
    assert repr(renderer) == f"<cltrace.Renderer 47x33: {more}>"


def test_an_image_is_an_array_of_its_bytes() -> None:
    pixels = np.arange(6, dtype=np.uint8).reshape(1, 2, 3)
    image = Image(rgb8=pixels, depth=np.zeros((1, 2)))
    assert np.asarray(image) is pixels
    assert np.array_equal(np.array(image), pixels)
    assert not np.shares_memory(np.array(image, copy=True), pixels)
    assert np.asarray(image, float).tolist() == pixels.tolist()
    assert np.asarray(image, float).dtype == float
    assert np.array_equal(np.asarray(Picture.fromarray(np.asarray(image))), pixels)
    with pytest.raises(ValueError, match=r"^copy: its bytes are uint8, and cannot become float64 without a copy$"):
        image.__array__(float, copy=False)
    with pytest.raises(ValueError, match=r"^show: the image has no rgb8, only depth; show='depth' shows what it has$"):
        np.asarray(Image(depth=np.zeros((1, 2))))


def _in_a_fork(queue: multiprocessing.Queue[str], attempts: list[Callable[[], object]]) -> None:
    for attempt in attempts:
        try:
            attempt()
            queue.put("rendered")
        except cltrace.DeviceError as error:
            queue.put(str(error))


@pytest.mark.filterwarnings("ignore:.*multi-threaded.*:DeprecationWarning")
def test_a_fork_is_told(any_device: Device) -> None:
    """Whatever would ask the driver for something: it would wait for threads that the fork has lost."""
    scene = usual_scene()
    renderer = Renderer(scene, any_device)
    image = renderer.render()
    attempts: list[Callable[[], object]] = [
        lambda: cltrace.render(scene),
        renderer.render,
        lambda: renderer.render(image),
        renderer.work,
        lambda: renderer.look(scene.camera),
        lambda: Renderer(scene, any_device),
        cltrace.devices,
    ]
    context = multiprocessing.get_context("fork")
    queue = context.Queue()
    process = context.Process(target=_in_a_fork, args=(queue, attempts))
    process.start()
    for _ in attempts:
        assert queue.get(timeout=60).startswith("OpenCL does not survive a fork")
    process.join(60)


FORKS = """
import os
import cltrace

scene = cltrace.Scene.from_spheres(cltrace.Camera(resolution=(16, 9)), [cltrace.ambient_light()], [(0, 0, 0)], [1])
for parent in (0, 1):
    child = os.fork()
    if not child or parent:
        assert cltrace.render(scene).rgb8.any()
        os.write(1, f"{cltrace.render(scene).rgb8.sum()}\\n".encode())  # at once: the other one may write, too
    if not child:
        os._exit(0)
    assert os.waitpid(child, 0)[1] == 0
"""


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "fork"), reason="there are no forks")
def test_what_forks_before_its_first_picture_draws_everywhere() -> None:
    """As a server's workers do, which import what they need only once."""
    done = subprocess.run([sys.executable, "-c", FORKS], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    assert len(set(done.stdout.split())) == 1
    assert len(done.stdout.split()) == 3


def test_show_encodings() -> None:
    image = Image(
        rgb8=np.full((1, 2, 3), 7, np.uint8),
        normal=np.array([[[0, 0, 1], [0, 0, 0]]], np.float32),
        depth=np.array([[2.0, np.inf]]),
        id=np.array([[3, -1]], np.int32),
        primitive=np.array([[0, -1]], np.int32),
        uv=np.array([[[1.2, -0.4], [0, 0]]], np.float32),
    )
    assert image.as_rgb8("color").tolist() == [[[7, 7, 7], [7, 7, 7]]]
    assert image.as_rgb8("normal").tolist() == [[[128, 128, 255], [0, 0, 0]]]
    assert image.as_rgb8("depth").tolist() == [[[32, 32, 32], [0, 0, 0]]]
    for name in ("id", "primitive"):
        assert image.as_rgb8(name)[0, 0].min() >= 64
        assert not image.as_rgb8(name)[0, 1].any()
    assert image.as_rgb8("uv").tolist() == [[[51, 153, 0], [0, 0, 0]]]
    for show, message in (
        ("direction", "the image has no direction, only rgb8, normal, depth, id, primitive, uv; show='color'"),
        ("heat", "must be one of color, normal, direction, depth, id, primitive, uv, got 'heat'"),
    ):
        with pytest.raises(ValueError, match=f"^show: {message}"):
            image.as_rgb8(show)
    assert image._repr_png_().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("path", "error", "message"),
    [
        ("x.png/", ValueError, "path: 'x.png/' is the name of a folder"),
        ("a/b/x.png", FileNotFoundError, "path: there is no folder 'a/b'; mkdir() of a Path makes one"),
        (7, TypeError, "path: must be a str or a Path, got 7"),
        ("x.png", ValueError, "show: the image has no rgb8, only depth; show='depth' shows what it has"),
    ],
)
def test_no_place_for_a_picture(path: object, error: type[Exception], message: str, own_folder: None) -> None:
    with pytest.raises(error) as caught:
        Image(depth=np.zeros((1, 1))).save(path)  # type: ignore[arg-type]
    assert str(caught.value) == message
    assert not list(Path().iterdir())


def test_images_of_arrays() -> None:
    """Nothing, or what is given; a copy is the same."""
    assert repr(Image()) == "<cltrace.Image 0x0: >"
    assert Image().seconds == {}
    with pytest.raises(AttributeError, match=r"^the image has no id, only nothing; ask for it with outputs="):
        Image().id  # noqa: B018
    depth = np.ones((2, 3))
    for image in (Image(depth=depth), copy.copy(Image(depth=depth)), copy.deepcopy(Image(depth=depth))):
        assert repr(image) == "<cltrace.Image 3x2: depth>"
        assert image.outputs == ("depth",)
        assert np.array_equal(image.depth, depth)


def test_what_is_no_path() -> None:
    with pytest.raises(TypeError, match=r"^path: must be a str or a Path, got 7$"):
        cltrace.load(7)  # type: ignore[arg-type]


def test_version() -> None:
    root = Path(__file__).parents[2]
    assert f'\nversion = "{cltrace.__version__}"\n' in (root / "pyproject.toml").read_text("utf-8")


SOURCE = """
import sys
sys.path.insert(0, sys.argv[1])
sys.meta_path[:] = [finder for finder in sys.meta_path if "editable" not in getattr(finder, "__module__", "")]
import cltrace.run.program as program
assert program.__file__.startswith(sys.argv[1]), program.__file__
try:
    print(program.source(("trace.cl",)), end="")
except program.BuildError as error:
    print(error)
"""


def test_a_script_beside_the_checkout(tmp_path: Path) -> None:
    """Where a folder named cltrace is beside a script, as a clone is, it must not be taken for an empty package."""
    (tmp_path / "cltrace").mkdir()
    script = "import cltrace; print(cltrace.__version__)"
    done = subprocess.run([sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.stdout.strip(), done.stderr) == (cltrace.__version__, "")


def test_python_in_a_checkout_finds_its_kernels(tmp_path: Path) -> None:
    """Installed, not editable: the checkout's cltrace comes first, and in it there is no cltrace.kernels."""
    root = Path(__file__).parents[2]
    shutil.copytree(root / "cltrace", tmp_path / "cltrace", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copytree(root / "kernels", tmp_path / "kernels", ignore=shutil.ignore_patterns("__pycache__"))

    def printed() -> str:
        command = [sys.executable, "-I", "-c", SOURCE, str(tmp_path)]
        return subprocess.run(command, capture_output=True, check=True, text=True).stdout

    assert printed() == '#line 1 "kernels/trace.cl"\n' + (root / "kernels" / "trace.cl").read_text("utf-8")
    shutil.rmtree(tmp_path / "kernels")
    assert printed() == "the kernel's files are missing: no package cltrace.kernels; install cltrace again\n"


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"scene": "file.xml"}, TypeError, "scene: must be a cltrace.Scene"),
        ({"device": 0}, TypeError, "device: must be a text"),
        ({"precision": "half"}, ValueError, "precision: must be one of accurate, single, double, got 'half'"),
        ({"outputs": ()}, ValueError, "outputs: must be some of "),
        ({"outputs": "id"}, ValueError, "outputs: must be a tuple, such as ('id',), got 'id'"),
        ({"antialias": 10**400}, ValueError, "antialias: must be True or False, got 1000"),
        ({"truncate": "no"}, ValueError, "truncate: must be True or False, got 'no'"),
        ({"width": True}, ValueError, "width: must be 1, 4, 8, 16 or None, got True"),
        ({"width": "16"}, ValueError, "width: must be 1, 4, 8, 16 or None, got '16'"),
        ({"crop": 5}, ValueError, "crop: must be 4 whole numbers (x0, y0, x1, y1), got 5"),
        ({"crop": (True, 0, 2, 2)}, ValueError, "crop: must be 4 whole numbers (x0, y0, x1, y1), got (True, 0, 2, 2)"),
        ({"crop": (0, 0, 99, 2)}, ValueError, "crop: must be within 0,0,47,33 and not empty, got 0,0,99,2"),
    ],
)
def test_refused_arguments(arguments: dict[str, object], error: type[Exception], message: str) -> None:
    with pytest.raises(error) as caught:
        Renderer(**{"scene": usual_scene(), **arguments})  # type: ignore[arg-type]
    assert str(caught.value).startswith(message)


def test_numbers_of_numpy() -> None:
    scene, of = usual_scene(), np.arange(64)
    smooth = Renderer(scene, antialias=True, samples=of[16], width=of[8], crop=of[[3, 4, 20, 9]])
    want = Renderer(scene, antialias=True, samples=16, width=8, crop=(3, 4, 20, 9))
    assert (smooth.request, smooth.width) == (want.request, want.width)
    assert np.array_equal(smooth.render().rgb8, want.render().rgb8)
    assert np.array_equal(want.cropped(of[[3, 5, 9, 8]]).render().rgb8, want.cropped((3, 5, 9, 8)).render().rgb8)


def test_another_camera_keeps_what_no_camera_changes(device: Device) -> None:
    """The picture is that of a Renderer made from scratch, to the bit; the eye of the last camera is in a sphere."""
    scene = usual_scene()
    renderer = Renderer(scene, device, outputs=EVERY)
    for eye, size in (((6, 1, 3), (47, 33)), ((0, 2, 12), (31, 47)), (scene.spheres["center"][0], (47, 33))):
        camera = cltrace.Camera(tuple(eye), (0.1, 0.2, 0.3), horizontal_fov=40, resolution=size)
        moved = renderer.look(camera)
        image, want = moved.render(), cltrace.render(replace(scene, camera=camera), device, outputs=EVERY)
        for output in EVERY:
            assert np.array_equal(getattr(image, output), getattr(want, output)), (eye, output)
        for name in ("id_of", "material", "material_of"):
            assert moved._executor.buffers[name] is renderer._executor.buffers[name]
        renderer = moved
    with pytest.raises(ValueError, match="crop: must be within 0,0,20,20"):
        Renderer(scene, device, crop=(30, 20, 40, 33)).look(replace(scene.camera, resolution=(20, 20)))


@pytest.mark.parametrize(("patience", "most"), [(0.0, 2**22), (1e9, 2**22), (1e9, 1)])
def test_strips_of_any_height_are_one_picture(
    device: Device, monkeypatch: pytest.MonkeyPatch, patience: float, most: int
) -> None:
    """A slow frame is cut into strips of 16 rows, a fast one into ever larger ones, of no more than STRIP pixels."""
    scene = cltrace.Scene.from_spheres(
        cltrace.Camera((0, 0, 9), (0, 0, 0), resolution=(50, 333)), [cltrace.point_light((5, 8, 9))], [(0, 0, 0)], [4.0]
    )
    monkeypatch.setattr(executor, "PATIENCE", 1e9)
    monkeypatch.setattr(executor, "FIRST_ROWS", 1024)
    want = cltrace.render(scene, device, outputs=("rgb8", "id"))
    monkeypatch.setattr(executor, "PATIENCE", patience)
    monkeypatch.setattr(executor, "FIRST_ROWS", 64)
    monkeypatch.setattr(executor, "STRIP", most)
    renderer = Renderer(scene, device, outputs=("rgb8", "id"))
    for _ in range(2):
        image = renderer.render()
        assert np.array_equal(image.rgb8, want.rgb8)
        assert np.array_equal(image.id, want.id)
    assert renderer._executor.pace.rows == 16 if patience == 0 else renderer._executor.pace.rows > 333 or most == 1
    assert repr(image) == "<cltrace.Image 50x333: rgb8, id>"
