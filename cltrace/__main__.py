"""The program `cltrace`, also python -m cltrace."""

import sys
from typing import NoReturn

from cltrace.process.entry import start, start_forkserver


def main() -> NoReturn:
    """Runs the command line and leaves with its exit status."""
    start("cltrace.cli", _begin_cluster)


def _begin_cluster() -> None:
    """Where a cluster of this machine is asked for, its first process starts beside the imports of this one."""
    if "--cluster local" in " ".join(sys.argv).replace("=", " "):
        start_forkserver("cltrace.distributed")


if __name__ == "__main__":
    main()
