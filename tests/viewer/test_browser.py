"""The page in a real browser: the hand's, the eye's and the keyboard's ways. It is there where Chromium is."""

from __future__ import annotations

import base64
import io
import re
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image as Picture
from test_server import FILE, viewer

import cltrace

pytestmark = pytest.mark.slow
sync_api = pytest.importorskip("playwright.sync_api", reason="pip install playwright drives the browser")
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
SIZE = cltrace.load(FILE).camera.resolution


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    if not CHROMIUM:
        pytest.skip("there is no Chromium: apt-get install chromium")
    with sync_api.sync_playwright() as play:
        found = play.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield found
        found.close()


@pytest.fixture
def page(browser: Any) -> Iterator[Any]:
    """A window in which nothing goes wrong unnoticed."""
    faults: list[str] = []
    context = browser.new_context(viewport={"width": 1200, "height": 700}, accept_downloads=True)
    found = context.new_page()
    found.on("pageerror", lambda error: faults.append(str(error)))
    found.on("console", lambda message: faults.append(message.text) if message.type == "error" else None)
    found.set_default_timeout(60_000)
    yield found
    context.close()
    assert faults == []


def rested(page: Any) -> None:
    """Waits for the last picture: where something has moved, a small one comes soon, and the smooth one at the end.

    A browser may be late to tell of a movement, so that a smooth picture is the last one only if none follows.
    """
    before = None
    while (now := shown(page).tobytes()) != before:
        before = now
        page.wait_for_timeout(400)
        page.wait_for_selector("#picture[data-kind=smooth]")


def opened(page: Any, address: str) -> None:
    page.goto(address)
    rested(page)


def shown(page: Any) -> np.ndarray:
    """The bytes of the canvas."""
    data = page.locator("#picture").evaluate("(canvas) => canvas.toDataURL()")
    with Picture.open(io.BytesIO(base64.b64decode(data.partition(",")[2]))) as picture:
        return np.asarray(picture.convert("RGB"))


def drag(page: Any, across: float, down: float) -> None:
    """Drags the middle of the picture, and waits for the last picture."""
    x, y = middle(page)
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + across, y + down, steps=6)
    page.mouse.up()
    page.wait_for_selector("#picture:not([data-kind=smooth])")
    rested(page)


def press(page: Any, key: str) -> None:
    """Presses a key on the picture, and waits for the last picture."""
    page.focus("#picture")
    page.keyboard.press(key)
    rested(page)


def middle(page: Any) -> tuple[float, float]:
    box = page.locator("#picture").bounding_box()
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


def camera_of(page: Any) -> cltrace.Camera:
    """What the button copies."""
    page.click("text=Python")
    page.wait_for_timeout(300)
    return eval(page.input_value("textarea"), {"cltrace": cltrace})


@pytest.fixture(scope="module")
def address(spec: str) -> Iterator[str]:
    with viewer(spec, str(FILE)) as running:
        yield running.address


def test_hand(page: Any, address: str, spec: str) -> None:
    """Drag, shift and drag, wheel, double click, click; what is saved is what is seen, exactly."""
    opened(page, address)
    scene = cltrace.load(FILE)
    assert (shown(page) == cltrace.render(scene, spec, antialias=True).rgb8).all()
    assert page.title().endswith("minimal.xml")

    x, y = middle(page)
    page.mouse.click(x, y)
    page.wait_for_selector("#explanation details")
    assert "meets sphere 0" in page.inner_text("#explanation")
    assert f"{FILE}:" in page.inner_text("#explanation")
    ray = page.locator("#explanation summary", has_text=re.compile("^Ray$"))
    assert not page.is_visible("text=/^o = /")
    ray.click()
    assert page.is_visible("text=/^o = /")
    assert page.input_value("#column") == str(SIZE[0] // 2)

    drag(page, 60, -30)
    turned = camera_of(page)
    assert turned.lookat == scene.camera.lookat
    assert turned.position != scene.camera.position
    assert (shown(page) == cltrace.render(scene.seen_by(turned), spec, antialias=True).rgb8).all()
    with page.expect_download() as waiting:
        page.click("#save")
    assert waiting.value.suggested_filename == f"{FILE.stem}.png"
    with Picture.open(waiting.value.path()) as picture:
        assert (np.asarray(picture) == shown(page)).all()

    page.keyboard.down("Shift")
    drag(page, 40, 0)
    page.keyboard.up("Shift")
    panned = camera_of(page)
    assert panned.lookat != turned.lookat
    page.mouse.move(x, y)
    page.mouse.wheel(0, -300)
    rested(page)
    near = camera_of(page)
    assert np.linalg.norm(near.position) < np.linalg.norm(panned.position)
    page.mouse.dblclick(x, y)
    rested(page)
    assert camera_of(page).lookat != near.lookat


def test_keys_reach_everything(page: Any, address: str) -> None:
    opened(page, address)
    home = camera_of(page)
    page.keyboard.press("Escape")
    for key, change in (("ArrowLeft", "position"), ("Shift+ArrowUp", "lookat"), ("+", "position"), ("f", "position")):
        before = camera_of(page)
        press(page, key)
        assert getattr(camera_of(page), change) != getattr(before, change), key
    press(page, "o")
    assert camera_of(page).parallel
    press(page, "u")
    assert not camera_of(page).parallel
    press(page, "r")
    assert camera_of(page) == home
    # From the first to the last control by tabs, each with a name that is read out.
    page.evaluate("() => document.activeElement.blur()")
    reached = set()
    for _ in range(40):
        page.keyboard.press("Tab")
        reached.add(page.evaluate("() => (document.activeElement.id || document.activeElement.textContent).trim()"))
    wanted = {"fit", "orthographic", "back", "undo", "XML", "Python", "command", "save", "picture", "column", "row"}
    assert reached >= wanted | {"why this colour?", "look there", "fov", "samples", "reset"}
    nameless = page.evaluate(
        """() => [...document.querySelectorAll('button, input, canvas:not([hidden]), textarea')].filter(
            (e) => !(e.textContent.trim() || e.labels?.length || e.getAttribute('aria-label'))).length"""
    )
    assert nameless == 0
    page.focus("#column")
    page.keyboard.press("Control+a")
    page.keyboard.type("240")
    page.keyboard.press("Tab")
    page.keyboard.type("180")
    page.keyboard.press("Enter")
    page.wait_for_selector("#explanation details")


def test_buttons_show_other_outputs(page: Any, address: str, spec: str) -> None:
    opened(page, address)
    scene = cltrace.load(FILE)
    for name in ("normal", "uv"):
        page.check(f"input[value={name}]")
        page.wait_for_function(f"() => document.querySelector('#caption').textContent.includes(': {name}, ')")
        assert (shown(page) == cltrace.render(scene, spec, outputs=(name,)).as_rgb8(name)).all()
    page.check("input[value=lit]")
    page.wait_for_function("() => document.querySelector('#caption').textContent.includes('light')")


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_dense_screens_and_schemes(browser: Any, address: str, scheme: str) -> None:
    """A pixel of the picture is a whole number of the screen's."""
    for density in (1, 2):
        size = {"width": 1600, "height": 1000}
        page = browser.new_page(viewport=size, device_scale_factor=density, color_scheme=scheme)
        opened(page, address)
        box = page.locator("#picture").bounding_box()
        assert (box["width"] * density) % SIZE[0] == pytest.approx(0, abs=1e-3)
        dark = np.asarray(Picture.open(io.BytesIO(page.screenshot())).convert("L"))[-5:, -5:].mean() < 128
        assert dark == (scheme == "dark")
        page.close()


def test_comparison(page: Any, spec: str, tmp_path: Path) -> None:
    mine, scene = tmp_path / "mine.png", cltrace.load(FILE)
    wrong = cltrace.render(scene, spec).rgb8[:, ::-1]
    cltrace.Image(rgb8=np.ascontiguousarray(wrong)).save(mine)
    with viewer(spec, str(FILE), "--compare", str(mine)) as running:
        page.goto(running.address)
        page.wait_for_selector("#comparison:not([hidden])")
        assert page.inner_text("#comparison").strip() == str(cltrace.compare(scene, mine, device=spec)).strip()
        rested(page)
        box = page.locator("#picture").bounding_box()
        page.fill("#slider", "100")
        over = np.asarray(Picture.open(io.BytesIO(page.screenshot(clip=box))).convert("RGB"))
        assert (over[: SIZE[1], : SIZE[0]] == wrong).mean() > 0.99
        page.fill("#slider", "0")
        under = np.asarray(Picture.open(io.BytesIO(page.screenshot(clip=box))).convert("RGB"))
        assert (under[: SIZE[1], : SIZE[0]] == shown(page)).mean() > 0.99
        page.check("#difference")
        press(page, "ArrowLeft")
        assert page.is_hidden("#other")
        press(page, "r")
        assert page.is_visible("#other")


def test_a_broken_line(page: Any, spec: str) -> None:
    """The page connects again, and goes on where it was; it says so where the server has gone."""
    keeping = "class extends WebSocket { constructor(...all) { super(...all); lines.push(this) } }"
    page.add_init_script(f"window.lines = []; WebSocket = {keeping}")
    with viewer(spec, str(FILE)) as running:
        opened(page, running.address)
        press(page, "ArrowLeft")
        before = shown(page)
        page.evaluate("lines[0].close()")
        page.wait_for_function("() => window.lines.length == 2 && !document.querySelector('#error').textContent")
        rested(page)
        assert (shown(page) == before).all()
    page.wait_for_selector("text=The server is not there")


def test_rays_over_the_picture(page: Any, address: str) -> None:
    """They are where the click was, turn with the camera, and are said in words; the outline waits for rest."""
    opened(page, address)
    x, y = middle(page)
    page.mouse.click(x, y)
    page.wait_for_selector("#outline:not([hidden])")
    circle = page.locator("#overlay circle").bounding_box()
    assert (circle["x"] + circle["width"] / 2, circle["y"] + circle["height"] / 2) == pytest.approx((x, y), abs=1)
    assert "1 ray of the pixel" in page.inner_text("#legend")
    assert "its light" in page.inner_text("#legend")
    ends = "() => [...document.querySelectorAll('#overlay line')].map((line) => line.getAttribute('x2')).join()"
    before = page.evaluate(ends)
    page.focus("#picture")
    page.keyboard.press("ArrowLeft")
    page.wait_for_function(f"(before) => ({ends})() !== before", arg=before)
    rested(page)
    page.wait_for_selector("#outline:not([hidden])")
    page.uncheck("#overlaid")
    assert page.is_hidden("#outline")
    assert page.locator("#overlay line").count() == 0


def test_sliders_and_movie(page: Any, spec: str, tmp_path: Path) -> None:
    """By keys: what each does is seen in the picture and said by the slider; play goes on by itself."""
    with viewer(spec, str(FILE), "--orbit", "5", "-o", "turn.gif", cwd=tmp_path) as running:
        opened(page, running.address)
        home = camera_of(page)

        def moved(slider: str, key: str) -> str:
            picture = "document.querySelector('#picture').toDataURL()"
            before = page.evaluate(picture)
            page.focus(slider)
            page.keyboard.press(key)
            page.wait_for_function(f"(before) => {picture} !== before", arg=before)
            rested(page)
            return str(page.get_attribute(slider, "aria-valuetext"))

        assert moved("#fov", "PageUp").endswith("°")
        assert camera_of(page).horizontal_fov > home.horizontal_fov
        assert moved("#samples", "ArrowRight") == "64"
        assert moved("#lights input >> nth=1", "Home") == "0 %"
        page.click("text=reset")
        page.wait_for_selector(f"#fov[aria-valuetext='{2 * home.horizontal_fov:g}°']")
        rested(page)
        assert page.input_value("#lights input >> nth=1") == "1"
        moved("#frames", "ArrowRight")
        assert camera_of(page) == cltrace.orbit(cltrace.load(FILE), 5)[1]
        page.click("#play")
        for number in (4, 1):
            page.wait_for_function(f"() => document.querySelector('#frame-number').value.startsWith('{number} of 5')")
        page.click("text=pause")
        page.click("text=write the movie")
        page.wait_for_selector("text=turn.gif is written")
        with Picture.open(tmp_path / "turn.gif") as movie:
            assert movie.n_frames == 5
        page.goto("about:blank")
