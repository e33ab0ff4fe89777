import runpy

import pytest
from paths import REPOSITORY

EXAMPLES = sorted((REPOSITORY / "examples").glob("[0-9]*.py"))


def test_there_are_examples():
    assert len(EXAMPLES) >= 2


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_ends_standing(path, capsys):
    assert runpy.run_path(str(path))["main"]()
    assert "stand" in capsys.readouterr().out
