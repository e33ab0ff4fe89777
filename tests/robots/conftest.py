import shutil
from pathlib import Path

import pytest

from robots import load_robot

TINY = Path(__file__).parent / "tiny"


@pytest.fixture(scope="session")
def op3():
    return load_robot("op3")


@pytest.fixture(scope="session")
def tiny():
    return load_robot(TINY)


@pytest.fixture
def own_robot(tmp_path):
    """A user's own robot folder, to be spoilt by the test."""
    return Path(shutil.copytree(TINY, tmp_path / "mine"))
