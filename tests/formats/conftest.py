"""Each test of files runs in a folder of its own."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Iterable
from pathlib import Path

import pytest

LIMITED = """
import resource, sys
resource.setrlimit(resource.RLIMIT_AS, (int(sys.argv[1]) << 20,) * 2)
from cltrace.formats.{0} import read_{0} as read
for name in sys.argv[2:]:
    try:
        read(name)
        print("read")
    except Exception as error:
        print(type(error).__name__, error)
"""


@pytest.fixture(autouse=True)
def _in_its_own_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")


@pytest.fixture
def limited() -> Callable[[str, int, Iterable[str]], list[str]]:
    """What a process with so many megabytes of addresses says of files of a kind, "obj" or "texture", a line each."""

    def read(kind: str, megabytes: int, names: Iterable[str]) -> list[str]:
        command = [sys.executable, "-c", LIMITED.format(kind), str(megabytes), *names]
        env = os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
        done = subprocess.run(command, env=env, capture_output=True, text=True, timeout=60, check=True)
        assert done.stderr == ""
        return done.stdout.splitlines()

    return read
