"""Where pictures go: names of files with a frame's number and a scene's name in them."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from cltrace.picture.files import is_named_as_folder

NUMBER = re.compile(r"%(0[1-9])?d")
# One file for all frames.
MOVIES = (".mp4", ".gif", ".apng")


class Pattern(NamedTuple):
    """The name of a file, or of as many as there are frames.

    text: in which %04d, or another number of digits, stands for a frame's number, and %% for a percent sign.
    """

    text: str

    @property
    def numbered(self) -> bool:
        """Whether each frame has a file of its own."""
        return NUMBER.search(self.text.replace("%%", "")) is not None

    @property
    def suffix(self) -> str:
        """Of the file, in small letters."""
        return Path(self.text).suffix.lower()

    def of(self, number: int) -> str:
        """The name of the file of a frame."""
        parts = self.text.split("%%")
        return "%".join(NUMBER.sub(lambda match: match.group() % number, part) for part in parts)


@dataclass(frozen=True)
class Listed:
    """Names of PNGs, by the numbers of their frames; more may be added."""

    names: dict[int, str]
    suffix: str = ".png"

    def of(self, number: int) -> str:
        """The name of the file of a frame."""
        return self.names[number]


def pattern_of(output: str, stem: str, frames: bool) -> Pattern:
    """What a user's output means.

    output: a name with %04d where there are frames, or a movie's; {} in it is the stem of the scene's name; a folder
    gets files of the stem's name. frames: whether there may be more than one frame. Raises ValueError, in words that
    belong behind the option's name.
    """
    if not output:
        raise ValueError("must not be empty")
    output = output.replace("{}", stem.replace("%", "%%") if frames else stem)
    if Path(output).is_dir() or is_named_as_folder(output):
        output = str(Path(output, f"{stem.replace('%', '%%')}%04d.png" if frames else f"{stem}.png"))
    if not frames:
        return Pattern(output.replace("%", "%%"))
    pattern = Pattern(output)
    count = len(NUMBER.findall(output.replace("%%", "")))
    if count > 1 or len(NUMBER.sub("", output.replace("%%", "")).split("%")) > 1:
        raise ValueError(
            f"must have one %d or %04d for the number of a frame, and %% for a percent sign, got {output!r}"
        )
    if pattern.suffix in MOVIES and count:
        raise ValueError(f"a movie is one file, and its name has no number, got {output!r}")
    if pattern.suffix == ".png" and not count:
        raise ValueError(f"must have a %04d for the number of a frame, such as frame%04d.png, got {output!r}")
    if pattern.suffix not in (*MOVIES, ".png"):
        raise ValueError(f"the name of frames must end in .png, of a movie in {', '.join(MOVIES)}, got {output!r}")
    return pattern
