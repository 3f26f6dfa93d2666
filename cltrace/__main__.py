"""The program `cltrace`, also python -m cltrace."""

from typing import NoReturn

from cltrace.start import start


def main() -> NoReturn:
    """Runs the command line and leaves with its exit status."""
    start("cltrace.cli")


if __name__ == "__main__":
    main()
