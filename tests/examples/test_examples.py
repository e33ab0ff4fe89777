"""The examples and the notebook run as they are, and the robot stands at their end."""

import json
import os
import re
import runpy
import subprocess
import sys
from pathlib import Path

import pytest
from paths import REPOSITORY

EXAMPLES = sorted((REPOSITORY / "examples").glob("[0-9]*.py"))
NOTEBOOK = REPOSITORY / "examples" / "rise.ipynb"
# Stands in for IPython, which a notebook always has and the tests have not.
DISPLAY = "from pathlib import Path; Image = lambda filename: Path(filename).stat().st_size"


def test_there_are_four_examples_and_they_are_numbered():
    assert [path.name[:3] for path in EXAMPLES] == ["01_", "02_", "03_", "04_"]


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_ends_standing(path, capsys, monkeypatch):
    monkeypatch.setattr(sys, "argv", [str(path)])
    runpy.run_path(str(path))
    lines = capsys.readouterr().out.splitlines()
    rises = [line for line in lines if "op3, " in line or "heavy_head, " in line]
    assert rises
    assert all("stands after" in line for line in rises), lines


def test_the_first_example_is_short_and_is_that_of_the_readme():
    code = EXAMPLES[0].read_text("utf-8").split('"""\n\n', 1)[1]
    assert len(code.splitlines()) <= 12
    for page in ("README.md", "docs/how-to/use_as_library.md"):
        shown = re.findall(r"```python\n(.*?)```", (REPOSITORY / page).read_text("utf-8"), re.S)
        assert code in shown, page


def test_the_notebook_runs_and_holds_no_output(tmp_path: Path):
    cells = json.loads(NOTEBOOK.read_text("utf-8"))["cells"]
    code = [cell for cell in cells if cell["cell_type"] == "code"]
    assert len(code) >= 4
    assert [cell["outputs"] for cell in code] == [[]] * len(code)
    (tmp_path / "IPython").mkdir()
    # matplotlib looks at the version of an IPython that is imported
    (tmp_path / "IPython" / "__init__.py").write_text("version_info = (9, 0)", "utf-8")
    (tmp_path / "IPython" / "display.py").write_text(DISPLAY, "utf-8")
    program = "\n".join("".join(cell["source"]) for cell in code) + "\nassert result.stood\n"
    path = os.pathsep.join([str(tmp_path), str(REPOSITORY)])
    subprocess.run(
        [sys.executable, "-c", program],
        check=True,
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": path},
    )
    assert (tmp_path / "torque.png").read_bytes().startswith(b"\x89PNG")
