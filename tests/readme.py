"""Prints the commands of the README, one code block after the other, for CI to run them as they stand."""

from __future__ import annotations

import re
from pathlib import Path

README = Path(__file__).parent.parent / "README.md"


def commands() -> list[str]:
    """The contents of the README's ```bash blocks, in order."""
    return re.findall(r"^```bash\n(.*?)^```", README.read_text("utf-8"), re.MULTILINE | re.DOTALL)


if __name__ == "__main__":
    print("\n".join(commands()))
