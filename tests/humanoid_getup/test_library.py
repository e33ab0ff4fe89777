"""`import humanoid_getup as hg`: what it gives, and that it costs nothing before it is used."""

import ast
import importlib
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import humanoid_getup as hg
from drivers.dynamixel.backend import DynamixelBackend
from humanoid_getup.execution.result import AttemptStatus, RiseResult
from humanoid_getup.execution.session import Session
from humanoid_getup.experiments.judging.judge import GroundTruthJudge, SensorJudge
from humanoid_getup.scenes.scene import FLAT_SCENE

LIMIT = hg.TorqueLimit(2.5, "pwm")
MOTION = "prone_push_up_gentle"


def run_python(program: str, **environment: str) -> list[str]:
    variables = {k: v for k, v in os.environ.items() if k not in ("MUJOCO_GL", "DISPLAY")}
    done = subprocess.run(
        [sys.executable, "-c", program],
        capture_output=True,
        text=True,
        check=True,
        env=variables | environment,
    )
    return done.stdout.split()


def test_importing_the_package_imports_neither_mujoco_nor_numpy():
    heavy = ("mujoco", "numpy", "scipy", "onnxruntime", "robots", "drivers")
    program = f"import sys, humanoid_getup; print(*[m for m in {heavy} if m in sys.modules])"
    assert run_python(program) == []


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux renders without a display by EGL")
@pytest.mark.parametrize(
    ("environment", "chosen"),
    [({}, "egl"), ({"MUJOCO_GL": "osmesa"}, "osmesa"), ({"DISPLAY": ":0"}, "None")],
)
def test_a_gl_is_chosen_before_mujoco_unless_the_user_did_or_there_is_a_display(
    environment, chosen
):
    program = "import os, humanoid_getup; print(os.environ.get('MUJOCO_GL'))"
    assert run_python(program, **environment) == [chosen]


def test_every_public_name_is_there_and_is_listed():
    names = "load_robot Body World Twin DynamixelBackend SafetyGuard TorqueLimit sample_fall get_up"
    names += (
        " keep_stand PlannedRise CachedRise PlanCache LearnedRise StoredMotion Motion OnnxPolicy"
        " SessionOptions Style StyleCurves StyledRise load_style"
        " import_robot check_robot build_motions retarget discover import_keys import_clip"
        " extract_style plan preflight preview make_prior train export evaluate benchmark"
        " measure_robot CancelledError Progress"
    )
    requests = {name for name in hg.__all__ if name.endswith("Request") or name.startswith("Bench")}
    assert set(hg.__all__) - requests == set(names.split())
    for name in hg.__all__:
        assert getattr(hg, name).__name__ == name
    assert set(hg.__all__) <= set(dir(hg))
    with pytest.raises(AttributeError, match="has no attribute 'PlanedRise'"):
        _ = hg.PlanedRise


def test_type_checkers_see_the_names_that_are_imported():
    tree = ast.parse(Path(str(hg.__file__)).read_text("utf-8"))
    (typed,) = [node for node in tree.body if isinstance(node, ast.If)]
    imports = [node for node in typed.body if isinstance(node, ast.ImportFrom)]
    seen = {alias.name: str(node.module) for node in imports for alias in node.names}
    assert sorted(seen) == sorted(hg.__all__)
    for name, module in seen.items():
        assert getattr(importlib.import_module(module), name) is getattr(hg, name)


def test_a_world_is_named_or_given(op3):
    assert hg.World(op3).scene.name == hg.World(op3, FLAT_SCENE).scene.name
    with pytest.raises(ValueError, match="unknown scene 'moon'"):
        hg.World(op3, "moon")


def test_a_fall_is_of_the_class_and_the_seed(world):
    fall = hg.sample_fall(world, "left", seed=1)
    assert fall.start_class == "left"
    same = hg.sample_fall(world, "left", seed=1).posture
    assert np.array_equal(fall.posture.joint_pos, same.joint_pos)
    with pytest.raises(ValueError, match="'upside', expected supine, prone, left, right"):
        hg.sample_fall(world, "upside")


def test_a_twin_starts_where_it_is_put(world):
    fall = hg.sample_fall(world, "prone", seed=1)
    twin = hg.Twin(world, fall.posture)
    assert np.array_equal(twin.truth.posture.joint_pos, fall.posture.joint_pos)
    assert twin.data.time == 0.0


def test_a_strategy_brings_its_torque_limit_to_the_twin_and_its_guard(world):
    twin, strategy = hg.Twin(world), hg.StoredMotion(world, MOTION, torque_limit=LIMIT)
    session = Session.on(twin, world, strategy.torque_limit)
    assert twin.limit_by == "pwm"
    assert np.all(session.guard.limits.torque_limit == 2.5)
    assert isinstance(session.make_judge(), GroundTruthJudge)
    Session.on(twin, world)
    assert twin.limit_by == "current", "OP3's own"


def test_a_guard_is_taken_as_it_is(world):
    guard = hg.SafetyGuard(hg.Twin(world))
    session = Session.on(guard, world)
    assert session.guard is guard
    assert isinstance(session.make_judge(), GroundTruthJudge)


def test_a_robot_on_a_bus_is_judged_by_its_sensors_and_may_reboot_servos(op3, world):
    backend = DynamixelBackend(op3, {"main": "/dev/none"})
    session = Session.on(backend, world)
    assert isinstance(session.make_judge(), SensorJudge)
    assert session.services is backend


def test_a_strategy_for_another_robot_is_refused(tiny, world):
    with pytest.raises(ValueError, match="for robot 'op3', expected 'tiny' with the same joints"):
        hg.get_up(hg.Twin(tiny), hg.StoredMotion(world, MOTION))


def test_what_is_not_a_strategy_is_refused_in_one_line(world):
    expected = r"strategy is 'robust', expected e\.g\. PlannedRise\(world\)"
    with pytest.raises(TypeError, match=expected):
        hg.get_up(hg.Twin(world), "robust")
    with pytest.raises(TypeError, match=r"strategy is <class .*PlannedRise'>, expected"):
        hg.get_up(hg.Twin(world), hg.PlannedRise)


@pytest.mark.parametrize(
    "make",
    [
        lambda world: hg.PlannedRise(world, torque_limit=2.5),
        lambda world: hg.LearnedRise(world, "robust", torque_limit=2.5),
        lambda world: hg.StoredMotion(world, MOTION, torque_limit=2.5),
    ],
)
def test_a_torque_limit_is_not_a_number(world, make):
    with pytest.raises(TypeError, match=r"torque_limit is 2\.5, expected e\.g\. TorqueLimit\(2"):
        make(world)


def test_a_loaded_policy_and_its_strategy_have_one_torque_limit(op3, world):
    policy = hg.OnnxPolicy.load(op3.folder / "policies" / "robust.onnx", op3, torque_limit=2.0)
    with pytest.raises(ValueError, match=r"limit of 2\.0 N·m, expected 2\.5 N·m"):
        hg.LearnedRise(world, policy, torque_limit=LIMIT)
    assert hg.LearnedRise(world, policy, torque_limit=hg.TorqueLimit(2.0)).torque_limit.value == 2.0


def test_a_stored_motion_is_named_or_given(world):
    by_name = hg.StoredMotion(world, MOTION).motion
    assert by_name.name == MOTION
    assert hg.StoredMotion(world, by_name).motion is by_name
    with pytest.raises(ValueError, match="unknown motion 'moonwalk', expected"):
        hg.StoredMotion(world, "moonwalk")


def test_a_rise_that_failed_says_so(op3):
    result = RiseResult(
        robot=op3, start_class="left", status=AttemptStatus.NEEDS_HELP, reason="no path"
    )
    assert str(result) == "op3, left: does not stand: no path"
