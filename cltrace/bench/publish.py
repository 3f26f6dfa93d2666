"""docs/benchmark.md in a checkout: its results, its figures, what it says of them, and whether they are still true."""

from __future__ import annotations

import re
from pathlib import Path

from cltrace.base.errors import UsageError
from cltrace.picture.files import whole_file

from . import points, report
from .points import Results, Work
from .texts import number

ROOT = Path(__file__).parents[2]
PAGE, RESULTS, COUNTED = Path("docs/benchmark.md"), Path("docs/benchmark.json"), Path("tests/bench/counted.json")
BEGIN, END = "<!-- made by cltrace-bench --publish -->", "<!-- until here -->"


def publish(results: Results, plots: bool) -> list[Path]:
    """Writes results, figures and page; of results with counted work alone, that and the page. Returns the files.

    Raises UsageError outside of a checkout.
    """
    if not (ROOT / PAGE).exists():
        raise UsageError("--publish writes docs/benchmark.md, and this is no checkout")
    written = []
    if results.points:
        written.append(_write(RESULTS, results.as_json().encode()))
    if plots and results.points:
        written += _draw(results)
    if results.work:
        written.append(_write(COUNTED, Results(_what(results), work=results.work, finished=True).as_json().encode()))
    text = (ROOT / PAGE).read_text("utf-8")
    head, _, tail = (part for part in re.split(f"({BEGIN}.*?{END})", text, maxsplit=1, flags=re.DOTALL))
    published, counted = points.load(ROOT / RESULTS), points.load(ROOT / COUNTED)
    written.append(_write(PAGE, f"{head}{block(published, counted.work)}{tail}".encode()))
    return written


def _what(results: Results) -> dict[str, object]:
    """Where work was counted, without what changes each day."""
    return {"devices": results.about["devices"]}


def block(published: Results, work: Work) -> str:
    """What stands between BEGIN and END: whether the figures are those of today's code, and the tables."""
    return "\n\n".join(
        part for part in (BEGIN, aged(published.work, work), report.summary(published).rstrip(), END) if part
    )


def aged(old: Work, now: Work) -> str:
    """Says that the figures are older than the code, if a frame takes other work today; else nothing."""
    ratios = {
        (scene, name): now[scene].get(name, 0) / count
        for scene, counts in old.items()
        for name, count in counts.items()
        if scene in now and count and now[scene].get(name, 0) != count
    }
    gone = sum(scene not in now for scene in old) + sum(scene not in old for scene in now)
    if not ratios and not gone:
        return ""
    scenes = {scene for scene, _ in ratios}
    text = (
        f"**These figures are older than the code**: the counted work of {len(scenes)} of {len(old)} scenes has changed"
    )
    if ratios:
        (scene, name), most = max(ratios.items(), key=lambda of: max(of[1], 1 / of[1] if of[1] else 1e9))
        text += f", most in {scene}, {name}, which is {number(most, 3)} times what it was"
    return text + (f"; {gone} scenes are other ones." if gone else ".")


def _draw(results: Results) -> list[Path]:
    """All figures of the device that was measured first, in both schemes, with the sentence of the page in the file."""
    from . import machine
    from .plots import SCHEMES, figures

    out = []
    device = next(point.device for point in results.points if point.device)
    for scheme in SCHEMES:
        for name, figure in figures(results, device, scheme).items():
            path = Path("docs") / f"{name}{scheme}.png"
            with whole_file(ROOT / path) as file:
                figure.savefig(
                    file, format="png", metadata={"Description": machine.sentence(results.about), "Software": None}
                )
            out.append(path)
    return out


def _write(path: Path, text: bytes) -> Path:
    with whole_file(ROOT / path) as file:
        file.write(text)
    return path
