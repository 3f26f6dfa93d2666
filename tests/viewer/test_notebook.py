"""Notebooks: one that is executed without a browser, and one in JupyterLab, in Chromium, where these are."""

# ruff: noqa: F401, F811
from __future__ import annotations

import base64
import io
import os
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image as Picture

# Fixtures and helpers of the page's tests: the widget is the same page.
from test_browser import SIZE, browser, middle, page, rested, shown
from test_server import FILE

import cltrace
from cltrace.run.devices import choose
from cltrace.viewer import cameras
from cltrace.viewer.messages import Event
from cltrace.viewer.session import Session
from cltrace.viewer.stage import Stage

pytestmark = pytest.mark.slow


def nbformat() -> Any:
    """Not imported above, as that takes seconds of whatever tests are run."""
    return pytest.importorskip("nbformat", reason="pip install jupyterlab")


# How a notebook's own elements look, which is none of the widget's business.
STYLES = """() => ['header', 'fieldset', 'button', 'p', 'pre', 'form', 'canvas'].map((name) => {
  const element = document.body.appendChild(document.createElement(name)), style = getComputedStyle(element);
  const found = [...style].map((property) => style.getPropertyValue(property)).join();
  element.remove();
  return found;
})"""


def notebook(spec: str, *cells: str) -> Any:
    first = f"import cltrace\nscene = cltrace.load({str(FILE)!r})\nview = cltrace.view(scene, {spec!r})\nview"
    kernel = {"kernelspec": {"name": "python3", "display_name": "Python 3"}}
    v4 = nbformat().v4
    return v4.new_notebook(metadata=kernel, cells=list(map(v4.new_code_cell, (first, *cells))))


def test_executed(spec: str, tmp_path: Path) -> None:
    """Its picture is the command's, and is in the page that nbconvert makes."""
    nbclient = pytest.importorskip("nbclient")
    nbconvert = pytest.importorskip("nbconvert")
    book = nbformat().from_dict(notebook(spec, "view.camera == scene.camera"))
    nbclient.NotebookClient(book, store_widget_state=False).execute()
    (output,) = book.cells[0].outputs
    cltrace.render(cltrace.load(FILE), spec).save(tmp_path / "exact.png")
    data = output["data"]["image/png"]
    assert base64.b64decode(data) == (tmp_path / "exact.png").read_bytes()
    assert book.cells[1].outputs[0]["data"]["text/plain"] == "True"
    html, _ = nbconvert.HTMLExporter().from_notebook_node(book)
    assert f'src="data:image/png;base64,{data.strip()}"' in html.replace("\n", "")


# Two views of one widget, whose kernel hears an event as soon as idle() is called.
TWO_VIEWS = """async ([code, data]) => {
  const picture = await (await fetch(`data:image/png;base64,${data}`)).arrayBuffer(), hearing = [];
  window.said = [];
  const model = { get: () => picture, on: (_, hear) => hearing.push(hear), send: (message, { iopub } = {}) => {
    if (message.event) said.push(JSON.parse(message.event));
    if (iopub?.status) window.idle = () => iopub.status({ content: { execution_state: 'idle' } });
  } };
  const { default: widget } = await import(URL.createObjectURL(new Blob([code], { type: 'text/javascript' })));
  for (const _ of [1, 2]) await widget.render({ model, el: document.body });
  window.roots = [...document.body.children].map((view) => view.shadowRoot);
  window.show = (head) => hearing.forEach((hear) => hear(head, [picture]));
  window.press = (key) => roots[0].querySelector('#picture').dispatchEvent(
    new KeyboardEvent('keydown', { key, bubbles: true }));
  window.slide = (value) => {
    const fov = roots[0].querySelector('#fov');
    fov.value = value;
    fov.dispatchEvent(new Event('input'));
  };
}"""


def test_two_views_of_a_busy_kernel(page: Any, spec: str) -> None:
    """Ways are added up and a slider's last place counts until it hears them; both views show the same buttons."""
    module = pytest.importorskip("cltrace.viewer.widget")
    session = Session(Stage(cltrace.load(FILE), choose(spec)))
    session.handle(Event("show", name="normal"))
    _, exact = session.draw(), session.draw()
    assert exact
    page.evaluate(TWO_VIEWS, [module._module(), base64.b64encode(exact.data).decode()])
    page.evaluate("(head) => show(head)", exact.head())
    checked = "() => roots.every((root) => root.querySelector('[name=view]:checked').value === 'normal')"
    page.wait_for_function(checked)
    page.evaluate("() => { said.length = 0; ['-', '+', '+', '+'].forEach(press); }")
    assert page.evaluate("said") == [{"kind": "zoom", "x": 0, "y": 0.25, "name": ""}]
    page.evaluate("() => [20, 30, 40].forEach(slide)")
    added, *rest = page.evaluate("said")[1:]
    assert ((added["kind"], added["y"]), rest) == (("zoom", -0.75), [])
    page.evaluate("idle()")
    assert page.evaluate("said.slice(2)") == [{"kind": "fov", "x": 40, "y": 0, "name": ""}]
    page.evaluate("() => { slide(50); press('f'); }")
    assert [event["kind"] for event in page.evaluate("said.slice(3)")] == ["fov", "fit"]


def answers(port: int) -> bool:
    """Whether somebody listens there."""
    with suppress(OSError), socket.create_connection(("127.0.0.1", port)):
        return True
    return False


@contextmanager
def jupyterlab(folder: Path) -> Iterator[str]:
    """JupyterLab in its dark theme, with settings of its own, which asks for no build. Yields its address."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    page = folder / "config" / "labconfig"
    page.mkdir(parents=True)
    (page / "page_config.json").write_text('{"buildCheck": false}')
    theme = folder / "config" / "lab" / "user-settings" / "@jupyterlab" / "apputils-extension"
    theme.mkdir(parents=True)
    (theme / "themes.jupyterlab-settings").write_text('{"theme": "JupyterLab Dark"}')
    own = {"JUPYTER_CONFIG_DIR": "config", "JUPYTER_DATA_DIR": "data", "JUPYTER_RUNTIME_DIR": "run", "IPYTHONDIR": "i"}
    env = os.environ | {name: str(folder / value) for name, value in own.items()}
    options = [
        "--no-browser",
        "--allow-root",
        f"--port={port}",
        "--ServerApp.port_retries=0",
        "--IdentityProvider.token=t",
    ]
    options += [f"--ServerApp.root_dir={folder}", "--LabApp.check_for_updates_class=jupyterlab.NeverCheckForUpdate"]
    line = [sys.executable, "-m", "jupyterlab", *options]
    log = folder / "log"
    with log.open("w") as said, subprocess.Popen(line, stderr=said, env=env) as process:
        try:
            while not answers(port):
                assert process.poll() is None, log.read_text()
                time.sleep(0.2)
            yield f"http://127.0.0.1:{port}/lab/tree/book.ipynb?token=t"
        finally:
            process.terminate()
            process.wait(60)


def test_in_jupyterlab(page: Any, spec: str, tmp_path: Path) -> None:
    """The hand, the keys, the theme; the notebook around it stays as it is; the next cell has the camera."""
    pytest.importorskip("jupyterlab")
    nbformat().write(notebook(spec, "print(view.camera)"), tmp_path / "book.ipynb")
    scene = cltrace.load(FILE)
    with jupyterlab(tmp_path) as address:
        page.goto(address)
        page.wait_for_selector("text=/^Python 3.* [|] Idle$/")  # cells that are run before do nothing
        before = page.evaluate(STYLES)
        page.locator(".jp-Cell >> nth=0 >> .cm-content").press("Shift+Enter")
        rested(page)
        assert page.evaluate(STYLES) == before
        home = cltrace.render(scene, spec, antialias=True).rgb8
        assert (shown(page) == home).all()
        assert luminance(page, "#views") < 100

        # Keys and the wheel are the widget's where it has the focus, and else the notebook's.
        x, y = middle(page)
        page.mouse.move(x, y)
        page.mouse.wheel(0, -100)
        rested(page)
        assert (shown(page) == home).all()
        page.mouse.down()
        page.mouse.move(x + 60, y - 30, steps=6)
        page.mouse.up()
        page.keyboard.press("o")
        rested(page)
        before = shown(page)
        page.mouse.wheel(0, -100)
        rested(page)
        assert (shown(page) != before).any()
        page.keyboard.press("ArrowLeft")
        page.keyboard.press("r")
        page.keyboard.press("u")
        page.keyboard.press("x")  # which cuts a cell
        rested(page)
        assert page.locator(".jp-CodeCell").count() == 2
        turned = shown(page)
        page.locator(".jp-Cell >> nth=1 >> .cm-content").press("Shift+Enter")
        printed = page.inner_text(".jp-Cell >> nth=1 >> .jp-OutputArea-output")
        camera = eval(f"cltrace.{printed}", {"cltrace": cltrace})
        assert isinstance(camera, cltrace.Orthographic)
        way = cameras.orbit(scene.camera, 60 / SIZE[1], -30 / SIZE[1])  # in sums, and the arrow is undone
        assert np.array(camera.basis()) == pytest.approx(np.array(way.basis()))
        assert (turned == cltrace.render(scene.seen_by(camera), spec, antialias=True).rgb8).all()
        page.close()  # before it misses its server


def luminance(page: Any, selector: str) -> float:
    """Of the corner of an element, 0 to 255."""
    with Picture.open(io.BytesIO(page.locator(selector).screenshot())) as picture:
        return float(np.asarray(picture.convert("L"))[-2:, -2:].mean())
