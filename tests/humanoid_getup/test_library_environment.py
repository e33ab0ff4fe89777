"""No program writes outside what was named, and none sends anything."""

import subprocess
import sys
from pathlib import Path

import pytest

from humanoid_getup.library_environment import prepare

PROGRAM = """
from humanoid_getup.cli.main import main
assert main(["run", "robust", "--from", "supine", "--seed", "1", "--out", "policy"]) == 0
assert main(["plan", "--from", "prone", "--json", "plan.json"]) == 0
"""


def test_a_policy_and_a_plan_write_into_their_folders_alone(tmp_path: Path):
    home, work, temporary = (tmp_path / name for name in ("home", "work", "tmp"))
    for folder in (home, work, temporary):
        folder.mkdir()
    places = {f"XDG_{name}_HOME": str(home / name) for name in ("CACHE", "CONFIG", "DATA", "STATE")}
    subprocess.run(
        [sys.executable, "-c", PROGRAM],
        check=True,
        cwd=work,
        env={
            "HOME": str(home),
            "TMPDIR": str(temporary),
            "PYTHONPATH": ":".join(path for path in sys.path if path),
            "PYTHONDONTWRITEBYTECODE": "1",
            **places,
        },
        capture_output=True,
    )
    assert {path.name for path in work.iterdir()} == {"policy", "plan.json"}
    assert list(home.rglob("*")) == []
    assert list(temporary.rglob("*")) == []


@pytest.mark.skipif(sys.platform != "linux", reason="EGL and Mesa are of Linux")
def test_without_a_display_mujoco_renders_by_egl_unless_another_gl_is_chosen():
    headless: dict[str, str] = {}
    prepare(headless)
    assert headless == {
        "MUJOCO_GL": "egl",
        "MESA_SHADER_CACHE_DISABLE": "true",
        "ORT_DISABLE_TELEMETRY": "1",
    }
    for chosen in ({"DISPLAY": ":0"}, {"MUJOCO_GL": "osmesa"}):
        environment = dict(chosen)
        prepare(environment)
        assert {key: environment.get(key) for key in ("DISPLAY", "MUJOCO_GL")} == {
            "DISPLAY": None,
            "MUJOCO_GL": None,
            **chosen,
        }
