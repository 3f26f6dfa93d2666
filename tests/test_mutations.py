"""Every mutation of tests/mutations.py has something to mutate, and tests that should find it."""

from pathlib import Path

from mutations import MUTATIONS


def test_targets_and_tests_are_there() -> None:
    assert [name for name, mutation in MUTATIONS.items() if not mutation.is_found()] == []
    files = {word for mutation in MUTATIONS.values() for word in mutation.tests.split() if word.startswith("tests/")}
    assert [file for file in files if not (Path(__file__).parents[1] / file).is_file()] == []
