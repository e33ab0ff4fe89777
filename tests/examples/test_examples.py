"""The examples and the notebook run as they are, and the robot stands at their end."""

import ast
import json
import os
import re
import runpy
import subprocess
import sys
from pathlib import Path

import pytest
from paths import REPOSITORY

import humanoid_getup as hg

EXAMPLES = sorted((REPOSITORY / "examples").glob("[0-9]*.py"))
IMPORT = "import humanoid_getup as hg"
NOTEBOOK = REPOSITORY / "examples" / "rise.ipynb"
# Stands in for IPython, which a notebook always has and the tests have not.
DISPLAY = "from pathlib import Path; Image = lambda filename: Path(filename).stat().st_size"


@pytest.mark.parametrize(
    "path",
    [EXAMPLES[0], *(pytest.param(path, marks=pytest.mark.slow) for path in EXAMPLES[1:])],
    ids=lambda path: path.stem,
)
def test_an_example_ends_standing(path, capsys, monkeypatch):
    monkeypatch.setattr(sys, "argv", [str(path)])
    runpy.run_path(str(path))
    lines = capsys.readouterr().out.splitlines()
    rises = [line for line in lines if "op3, " in line or "heavy_head, " in line]
    assert rises
    assert all("stands after" in line for line in rises), lines


@pytest.mark.parametrize("path", [*EXAMPLES, NOTEBOOK], ids=lambda path: path.stem)
def test_what_an_example_takes_from_the_library_is_there(path: Path):
    code = "\n".join(read_cells()) if path == NOTEBOOK else path.read_text("utf-8")
    nodes = list(ast.walk(ast.parse(code)))
    used = {
        node.attr
        for node in nodes
        if isinstance(node, ast.Attribute)
        if isinstance(node.value, ast.Name) and node.value.id == "hg"
    }
    assert {"load_robot", "World"} <= used
    assert [name for name in used if not hasattr(hg, name)] == []
    for node in nodes:
        if isinstance(node, ast.Import | ast.ImportFrom):
            exec(ast.unparse(node), {})


def read_cells() -> list[str]:
    """Return the code of the notebook's cells, but for what IPython alone has."""
    cells = json.loads(NOTEBOOK.read_text("utf-8"))["cells"]
    code = ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]
    return [cell.replace("from IPython.display import Image\n", "") for cell in code]


def test_the_first_example_is_short_and_is_that_of_the_readme():
    code = EXAMPLES[0].read_text("utf-8").split('"""\n\n', 1)[1]
    assert len(code.splitlines()) <= 12
    for page in ("README.md", "docs/how-to/use_as_library.md"):
        shown = re.findall(r"```python\n(.*?)```", (REPOSITORY / page).read_text("utf-8"), re.S)
        assert code in shown, page


@pytest.mark.slow
def test_the_work_of_commands_runs_as_the_page_shows_it(tmp_path, capsys, monkeypatch):
    page = (REPOSITORY / "docs/how-to/use_as_library.md").read_text("utf-8")
    section = page.split("## Do what the commands do")[1].split("\n## ")[0]
    blocks = re.findall(r"```python\n(.*?)```", section, re.S)
    assert len(blocks) == 3
    monkeypatch.chdir(tmp_path)
    exec("\n".join([IMPORT, *blocks]), {})
    out = capsys.readouterr().out
    assert out.startswith("True [")
    assert "Progress(phase='filtering'" in out
    assert "op3, squat: stands after" in out
    assert [path.name for path in tmp_path.iterdir()] == ["mine.toml"]


@pytest.mark.slow
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
