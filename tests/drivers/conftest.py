from pathlib import Path

import pytest

from robots import load_robot

TINY = Path(__file__).parent.parent / "robots" / "tiny"


@pytest.fixture(scope="session")
def op3():
    return load_robot("op3")


@pytest.fixture(scope="session")
def tiny():
    return load_robot(TINY)
