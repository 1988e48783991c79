"""One simulated flight for all tests here: flying it takes some seconds."""

import pytest

from tests.imports.flown import Flown, fly


@pytest.fixture(scope="session")
def flown() -> Flown:
    return fly()
