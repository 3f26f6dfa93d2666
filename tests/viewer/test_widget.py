"""The notebook's widget: what it says to its views and hears from them, and how it ends."""

from __future__ import annotations

import base64
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from queue import Queue
from typing import Any

import pytest

import cltrace
from cltrace.formats.reader import read
from cltrace.renderers.renderer import Renderer
from cltrace.run.devices import choose
from cltrace.viewer.stage import Stage

pytest.importorskip("anywidget", reason="the notebook's widget needs the extra view")
import traitlets

from cltrace.viewer import widget as module
from cltrace.viewer.widget import Widget

FILE = Path(__file__).parents[2] / "scenes" / "minimal.xml"
PICTURES = ("moving", "exact", "smooth")


class Shell(traitlets.HasTraits):
    """What says that a kernel stops."""

    exit_now = traitlets.Bool(False)
    kernel = None


@pytest.fixture
def shell(monkeypatch: pytest.MonkeyPatch) -> Shell:
    found = Shell()
    monkeypatch.setattr(module, "get_ipython", lambda: found)
    return found


class Notebook:
    """A notebook's side of a widget: each picture is on the screen as soon as it comes."""

    def __init__(self, widget: Widget, monkeypatch: pytest.MonkeyPatch) -> None:
        self.widget, self.said = widget, Queue[tuple[dict[str, Any], bytes]]()
        monkeypatch.setattr(widget, "send", lambda head, buffers: self.said.put((head, buffers[0])))

    def tell(self, **said: str) -> None:
        self.widget._handle_custom_msg(said, [])

    def until(self, kind: str) -> tuple[dict[str, Any], bytes]:
        while True:
            head, data = self.said.get(timeout=60)
            if head["kind"] in PICTURES:
                self.tell(event=f'{{"kind": "shown", "x": {head["number"]}}}')
            if head["kind"] == kind:
                return head, data


@pytest.fixture
def make(spec: str, shell: Shell, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[], Notebook]]:
    made = []

    def notebook() -> Notebook:
        made.append(Widget(Stage(read(str(FILE), True)[0], choose(spec))))
        return Notebook(made[-1], monkeypatch)

    yield notebook
    for widget in made:
        widget.close()
        ended(widget)


def ended(widget: Widget) -> None:
    """Waits for the end of what it does."""
    if widget._thread:
        widget._thread.join(20)
        assert not widget._thread.is_alive()


def test_pictures_are_the_commands(make: Callable[[], Notebook], spec: str, tmp_path: Path) -> None:
    notebook, scene = make(), cltrace.load(FILE)
    cltrace.render(scene, spec).save(tmp_path / "exact.png")
    cltrace.render(scene, spec, antialias=True).save(tmp_path / "smooth.png")
    notebook.tell(open="a")
    assert notebook.until("exact")[1] == (tmp_path / "exact.png").read_bytes()
    assert notebook.until("smooth")[1] == (tmp_path / "smooth.png").read_bytes()
    notebook.tell(event='{"kind": "explain", "x": 240, "y": 180}')
    assert "sphere 0" in notebook.until("explanation")[0]["text"]
    # What shows no widgets shows the exact picture.
    data, _ = notebook.widget._repr_mimebundle_()
    assert base64.b64decode(data["image/png"]) == (tmp_path / "exact.png").read_bytes() == notebook.widget.picture
    assert data["application/vnd.jupyter.widget-view+json"]["model_id"] == notebook.widget.model_id


def test_the_camera_is_the_hands(make: Callable[[], Notebook]) -> None:
    """All views of a widget have one camera, also those that come later; another widget has another one."""
    one, other = make(), make()
    home = cltrace.load(FILE).camera
    for notebook in (one, other):
        notebook.tell(open="a")
        notebook.until("smooth")
    one.tell(event='{"kind": "orbit", "x": 0.1}')
    one.until("smooth")
    assert one.widget.camera != home == other.widget.camera
    one.tell(open="b")
    assert one.until("exact")[0]["home"] is False
    one.tell(close="a")
    one.tell(event='{"kind": "back"}')
    assert one.until("exact")[0]["home"] is True
    assert one.widget.camera == home


@pytest.mark.parametrize(
    "end",
    [
        lambda notebook, shell: notebook.tell(close="a"),
        lambda notebook, shell: notebook.widget.close(),
        lambda notebook, shell: setattr(shell, "exit_now", True),
    ],
    ids=["view", "widget", "kernel"],
)
def test_work_ends(
    make: Callable[[], Notebook],
    shell: Shell,
    end: Callable[[Notebook, Shell], None],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """With its last view, with the widget and with the kernel, also in the midst of a picture."""
    begun = threading.Event()

    def draw_without_end(_: Renderer, drawn: Callable[[int], None]) -> None:
        begun.set()
        while True:
            drawn(0)
            time.sleep(0.01)

    notebook = make()
    with monkeypatch.context() as patch:
        patch.setattr(Renderer, "draw", draw_without_end)
        notebook.tell(open="a")
        assert begun.wait(20)
        end(notebook, shell)
        ended(notebook.widget)


def test_what_no_page_says_changes_nothing(make: Callable[[], Notebook]) -> None:
    """Nor what is said while no view is there; and a view may come after the last one has gone."""
    notebook = make()
    notebook.tell(event='{"kind": "back"}')
    notebook.tell(open="a")
    for said in ({"event": "no JSON"}, {"event": '{"kind": "fall"}'}, {"other": "a"}):
        notebook.tell(**said)
    notebook.tell(close="a")
    notebook.tell(event='{"kind": "orbit", "x": 0.1}')
    notebook.tell(open="b")
    assert notebook.until("exact")[0]["home"] is True


def test_a_program_in_a_notebook_gets_a_widget(spec: str, shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys.modules["IPython"], "get_ipython", lambda: shell)
    widget = cltrace.view(cltrace.load(FILE), spec)
    assert isinstance(widget, Widget)
    widget.close()
    monkeypatch.setitem(sys.modules, "anywidget", None)
    monkeypatch.delitem(sys.modules, "cltrace.viewer.widget")
    with pytest.raises(ImportError, match=r"cltrace\[view\]"):
        cltrace.view(cltrace.load(FILE), spec)
