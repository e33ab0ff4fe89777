"""No program writes outside what was named, and none sends anything."""

import atexit
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest
from paths import REPOSITORY

from humanoid_getup import library_environment
from humanoid_getup.library_environment import MATPLOTLIB_FOLDER, prepare

PROGRAM = """
import sys
from pathlib import Path
import numpy as np
sys.path.append(sys.argv[1])
from authored import load_robot_keyframes
from humanoid_getup.commands.main import main
from humanoid_getup.motions.trial import KeyframePopulation
from humanoid_getup.policy.onnx_policy import OnnxPolicy, find_policy
from humanoid_getup.reporting.film_strip import NoRendererError, render_frames, save_strip
from humanoid_getup.simulation.world import World
from robots import load_robot
from robots.kinematics import place
from tiny_policies import state_of

robot = load_robot("op3")
KeyframePopulation(load_robot_keyframes(robot)[0], robot, size=4, seed=0).ask()
policy, model = OnnxPolicy.load(find_policy(robot, "robust"), robot), World(robot).model
policy.reset(state_of(robot))
policy.step(state_of(robot))
try:
    pictures = render_frames(robot, model, place(robot, model, robot.standing)[None])
except NoRendererError:  # without OpenGL the figure alone is tried
    pictures = np.zeros((1, 8, 8, 3))
save_strip(pictures, [0.0], Path("strip.png"))
assert main(["plan", "--from", "prone", "--max-checks", "1", "--json", "plan.json"]) == 1
"""


def test_a_policy_a_picture_and_a_plan_write_what_is_named_alone(tmp_path: Path):
    pytest.importorskip("onnx")
    home, work, temporary = (tmp_path / name for name in ("home", "work", "tmp"))
    for folder in (home, work, temporary):
        folder.mkdir()
    places = {f"XDG_{name}_HOME": str(home / name) for name in ("CACHE", "CONFIG", "DATA", "STATE")}
    places |= {"HOME": str(home), "TMPDIR": str(temporary), "PYTHONDONTWRITEBYTECODE": "1"}
    places["PYTHONPATH"] = ":".join(path for path in sys.path if path)
    program = [sys.executable, "-c", PROGRAM, str(REPOSITORY / "tests" / "support")]
    subprocess.run(program, check=True, cwd=work, env=places, capture_output=True)
    assert {path.name for path in work.iterdir()} == {"strip.png", "plan.json"}
    assert list(home.rglob("*")) == []
    assert list(temporary.rglob("*")) == []


@pytest.mark.skipif(sys.platform != "linux", reason="EGL and Mesa are of Linux")
def test_without_a_display_mujoco_renders_by_egl_unless_another_gl_is_chosen():
    own = {"MESA_SHADER_CACHE_DISABLE": "true", "ORT_DISABLE_TELEMETRY": "1"}
    for chosen in ({}, {"DISPLAY": ":0"}, {"MUJOCO_GL": "osmesa"}):
        environment = dict(chosen)
        prepare(environment)
        assert own.items() <= environment.items()
        gl = {key: value for key, value in environment.items() if key not in own}
        assert gl == (chosen or {"MUJOCO_GL": "egl"})


@pytest.mark.parametrize("existing", ["", ".config/matplotlib", ".cache/matplotlib"])
def test_matplotlib_gets_another_folder_if_the_home_has_none_of_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, existing: str
):
    home, other = tmp_path / "home", tmp_path / "other"
    (home / existing).mkdir(parents=True)
    other.mkdir()
    monkeypatch.delitem(sys.modules, "matplotlib", raising=False)
    monkeypatch.setattr(tempfile, "mkdtemp", lambda **_: str(other))
    monkeypatch.setattr(atexit, "register", lambda *_, **__: None)
    monkeypatch.setenv("HOME", str(home))
    for name in ("XDG_CONFIG_HOME", "XDG_CACHE_HOME", MATPLOTLIB_FOLDER):
        monkeypatch.delenv(name, raising=False)
    library_environment.keep_matplotlib_out_of_home()
    assert os.environ.pop(MATPLOTLIB_FOLDER, None) == (None if existing else str(other))
