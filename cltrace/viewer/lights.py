"""The lights of a window, which may shine less than the scene says."""

from __future__ import annotations

from cltrace.explanation.names import Names
from cltrace.explanation.words import light
from cltrace.scene import Scene

# A window lists no more lights.
LISTED = 8


class Lights:
    """How bright each light is, as a share of what the scene says: 1 unless it is dimmed."""

    def __init__(self) -> None:
        self._strengths = dict[int, float]()
        self._last: tuple[Scene, dict[int, float], Scene] | None = None

    def dim(self, number: int, strength: float) -> bool:
        """Whether there is such a strength, which the light then has."""
        there = 0 <= number < LISTED and 0 <= strength <= 1
        if there:
            self._strengths = self._strengths | {number: strength}
        return there

    def on(self, scene: Scene) -> Scene:
        """A scene in these lights: the same one where none is dimmed, and else the same one each time."""
        strengths = {number: share for number, share in self._strengths.items() if number < len(scene.lights)}
        if all(share == 1 for share in strengths.values()):
            return scene
        if self._last is None or self._last[0] is not scene or self._last[1] != strengths:
            lights = scene.lights.copy()
            for number, share in strengths.items():
                for name in ("color", "below"):
                    lights[name][number] *= share
            dimmed = scene.lit_by(lights)
            self._last = scene, strengths, dimmed.read_from(scene.source) if scene.source else dimmed
        return self._last[2]

    def listed(self, scene: Scene) -> tuple[tuple[str, float], ...]:
        """The name and the strength of each light; none where there are many."""
        if len(scene.lights) > LISTED:
            return ()
        names = Names(scene)
        return tuple((light(names.light(k)), self._strengths.get(k, 1.0)) for k in range(len(scene.lights)))

    @property
    def as_python(self) -> str:
        """What a program does to the lights of its `scene`; "" where that is nothing."""
        dimmed = [(number, share) for number, share in self._strengths.items() if share != 1]
        if not dimmed:
            return ""
        changes = "".join(f"lights[{name!r}][{k}] *= {s!r}; " for k, s in dimmed for name in ("color", "below"))
        return f"lights = scene.lights.copy(); {changes}scene = scene.lit_by(lights); "
