"""Prints the README's and the documentation's commands and Python, for CI to run them as they stand, in a shell."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).parent.parent
FILES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]


def blocks(file: Path, language: str) -> list[str]:
    """The contents of a file's blocks in a language, in order."""
    return re.findall(rf"^```{language}\n(.*?)^```", file.read_text("utf-8"), re.MULTILINE | re.DOTALL)


def outputs(file: Path) -> list[tuple[str, str]]:
    """The file's bash blocks that a text block follows, each with that text, which is what the commands print."""
    return re.findall(
        r"^```bash\n((?:(?!```).*\n)*)```\n\n(?:(?!```).*\n)*?```text\n((?:(?!```).*\n)*)```$",
        file.read_text("utf-8"),
        re.MULTILINE,
    )


def commands(file: Path) -> str:
    """A shell script: the file's bash blocks, and then its Python blocks as one program, since they go together."""
    script = [f"echo '== {file.relative_to(ROOT)}'\n", *blocks(file, "bash")]
    if python := "\n".join(blocks(file, "python")):
        script.append(f".venv/bin/python - <<'END_OF_PYTHON'\n{python}END_OF_PYTHON\n")
    return "".join(script)


if __name__ == "__main__":
    # tests/test_docs.py runs those of wrong-picture.md, and looks at what they print.
    print("\n".join(commands(file) for file in FILES if file.name != "wrong-picture.md"))
