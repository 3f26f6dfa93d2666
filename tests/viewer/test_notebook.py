"""Notebooks: one that is executed without a browser, and views of a widget in Chromium, where these are."""

# ruff: noqa: F401, F811
from __future__ import annotations

import base64
from pathlib import Path
from typing import Any

import pytest

# Fixtures and helpers of the page's tests: the widget is the same page.
from test_browser import browser, page
from test_server import FILE

import cltrace
from cltrace.run.devices import choose
from cltrace.viewer.messages import Event, Message
from cltrace.viewer.session import Session
from cltrace.viewer.stage import Stage

pytestmark = pytest.mark.slow


# How a notebook's own elements look, which is none of the widget's business.
STYLES = """() => ['header', 'fieldset', 'button', 'p', 'pre', 'form', 'canvas'].map((name) => {
  const element = document.body.appendChild(document.createElement(name)), style = getComputedStyle(element);
  const found = [...style].map((property) => style.getPropertyValue(property)).join();
  element.remove();
  return found;
})"""


def test_executed(spec: str, tmp_path: Path) -> None:
    """Its picture is the command's, and is in the page that nbconvert makes."""
    nbclient, nbconvert = (pytest.importorskip(name) for name in ("nbclient", "nbconvert"))
    nbformat = pytest.importorskip("nbformat")  # which takes seconds of whatever tests are run
    first = f"import cltrace\nscene = cltrace.load({str(FILE)!r})\nview = cltrace.view(scene, {spec!r})\nview"
    cells = [*map(nbformat.v4.new_code_cell, (first, "view.camera == scene.camera"))]
    kernel = {"kernelspec": {"name": "python3", "display_name": "Python 3"}}
    book = nbformat.from_dict(nbformat.v4.new_notebook(metadata=kernel, cells=cells))
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
    new KeyboardEvent('keydown', { key, bubbles: true, composed: true }));
  window.slide = (value) => {
    const fov = roots[0].querySelector('#fov');
    fov.value = value;
    fov.dispatchEvent(new Event('input'));
  };
}"""


def two_views(page: Any, picture: Message) -> None:
    """Makes TWO_VIEWS, which show a picture."""
    module = pytest.importorskip("cltrace.viewer.widget")
    page.evaluate(TWO_VIEWS, [module._module(), base64.b64encode(picture.data).decode()])
    page.evaluate("(head) => show(head)", picture.head())


def test_two_views_of_a_busy_kernel(page: Any, spec: str) -> None:
    """Ways are added up and a slider's last place counts until it hears them; both views show the same buttons."""
    session = Session(Stage(cltrace.load(FILE), choose(spec)))
    session.handle(Event("show", name="normal"))
    session.draw()
    two_views(page, session.draw())
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


def test_a_fault_of_the_file_stands_over_the_picture(page: Any, spec: str) -> None:
    """Until the file is right again."""
    two_views(page, Session(Stage(cltrace.load(FILE), choose(spec))).draw())
    fault = "roots.map((root) => root.querySelector('#fault')).map((it) => it.checkVisibility() && it.textContent)"
    for text in ("s.xml:7: sphere: radius must be > 0, got -1", ""):
        page.evaluate("(text) => show({ kind: 'fault', text })", text)
        assert page.evaluate(fault) == [text or False] * 2


def test_the_page_around_a_view_stays_as_it_is(page: Any, spec: str) -> None:
    """Its elements look as before, and keys and the wheel are the view's only where it has the focus. The view is dark
    where the page's letters are light."""
    page.evaluate("() => { document.body.style.color = 'white'; window.heard = []; }")
    page.evaluate("() => addEventListener('keydown', ({ key }) => heard.push(key))")
    before = page.evaluate(STYLES)
    two_views(page, Session(Stage(cltrace.load(FILE), choose(spec))).draw())
    assert page.evaluate(STYLES) == before
    scheme = "roots[0].host.style.colorScheme"
    assert page.evaluate(scheme) == "dark"
    page.evaluate("() => { document.body.style.color = 'black'; }")
    page.wait_for_function(f"() => {scheme} === 'light'")
    page.evaluate("() => { said.length = 0; ['o', 'x'].forEach(press); }")
    assert page.evaluate("heard") == ["x"]
    assert page.evaluate("roots[0].host.dataset.lmSuppressShortcuts") == "true"  # by which JupyterLab leaves it alone
    wheel = """(focus) => { const picture = roots[0].querySelector('#picture'); if (focus) picture.focus();
      return picture.dispatchEvent(new WheelEvent('wheel', { deltaY: 9, cancelable: true })); }"""
    assert [page.evaluate(wheel, focus) for focus in (False, True)] == [True, False]
    assert [event["kind"] for event in page.evaluate("said")] == ["parallel", "zoom"]
