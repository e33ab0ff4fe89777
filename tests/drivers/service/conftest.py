"""Two servos on a bench, an XL430 with id 1 and an XM430 with id 3."""

import pytest
from desk import opening, serving_desk


@pytest.fixture
def desk():
    with serving_desk() as served:
        yield served


@pytest.fixture
def bus(desk):
    with opening(desk) as opened:
        yield opened
