"""What the tests of the viewer have in common."""

import pytest


@pytest.fixture(scope="session")
def spec(request: pytest.FixtureRequest) -> str:
    """The device, as --device has it."""
    return request.config.getoption("--device") or "cpu"
