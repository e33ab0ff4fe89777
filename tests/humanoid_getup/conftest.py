import shutil
from pathlib import Path

import pytest

from robots import Robot


@pytest.fixture
def copied_op3(tmp_path: Path, op3: Robot) -> Path:
    """A folder of OP3 with motions and no policies, to be spoiled by the test."""
    ignore = shutil.ignore_patterns("policies")
    return Path(shutil.copytree(op3.folder, tmp_path / "op3", ignore=ignore))
