"""The program `cltrace-bench`, also python -m cltrace.bench."""

from typing import NoReturn

from cltrace.process.entry import start


def main() -> NoReturn:
    """Runs the command line and leaves with its exit status."""
    start("cltrace.bench.cli")


if __name__ == "__main__":
    main()
