"""`import humanoid_getup as hg`: what it gives, and that it costs nothing before it is used."""

import math
import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import humanoid_getup as hg
from drivers.dynamixel.backend import DynamixelBackend
from humanoid_getup.commands.errors import BadInputError
from humanoid_getup.execution.result import AttemptStatus, RiseResult
from humanoid_getup.execution.session import Session
from humanoid_getup.experiments.falls import Fall
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
        " keep_stand PlannedRise LearnedRise StoredMotion Motion OnnxPolicy"
        " SessionOptions Style StyleCurves StyledRise load_style"
        " import_robot check_robot build_motions retarget discover discover_all import_keys"
        " import_clip extract_style plan preflight preview make_prior train export"
        " evaluate benchmark measure_robot rise play_motion run_policy sit hold watch"
        " replay_flight export_log export_motion export_robot CancelledError Progress"
        " ProgressMonitor import_policy check_policy"
    )
    requests = {name for name in hg.__all__ if name.endswith("Request") or name.startswith("Bench")}
    assert set(hg.__all__) - requests == set(names.split())
    for name in hg.__all__:
        assert getattr(hg, name).__name__ == name
    assert set(hg.__all__) <= set(dir(hg))
    with pytest.raises(AttributeError, match="has no attribute 'PlanedRise'"):
        _ = hg.PlanedRise


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


@pytest.mark.parametrize(
    "make",
    [
        lambda world: hg.PlannedRise(world, torque_limit=2.5),
        lambda world: hg.LearnedRise(world, "robust", torque_limit=2.5),
        lambda world: hg.StoredMotion(world, MOTION, torque_limit=2.5),
    ],
)
def test_a_torque_limit_is_not_a_number(world, make):
    with pytest.raises(ValueError, match=r"torque_limit is 2\.5, expected a TorqueLimit, e"):
        make(world)


def test_a_loaded_policy_and_its_strategy_have_one_torque_limit(op3, world):
    policy = hg.OnnxPolicy.load(op3.folder / "policies" / "robust.onnx", op3, torque_limit=2.0)
    with pytest.raises(ValueError, match=r"limit of 2\.0 N·m, expected 2\.5 N·m"):
        hg.LearnedRise(world, policy, torque_limit=LIMIT)
    assert hg.LearnedRise(world, policy, torque_limit=hg.TorqueLimit(2.0)).torque_limit.value == 2.0


lib: Any = hg
"""The package for calls that type checkers refuse."""
A_WORLD = "expected a World, e.g. World(robot)"
A_BACKEND = "backend is a World, expected a backend, e.g. Twin(world"
A_ROBOT = "expected a Robot, e.g. load_robot('op3')"
WRONG_ARGUMENTS: list[tuple[Callable[[hg.World], object], str]] = [
    (lambda _: lib.World("op3"), f"robot is 'op3', {A_ROBOT}"),
    (lambda w: lib.World(w.robot, 3), "scene is 3, expected a name, a .toml file or a Scene"),
    (lambda w: lib.World(w.robot, Path("x.toml")), "scene x.toml: No such file or directory"),
    (lambda _: lib.load_robot(None), "robot is None, expected a name or a folder"),
    (
        lambda _: lib.load_robot("op3", "arms=1.6"),
        "body is 'arms=1.6', expected a Body, e.g. Body(arms=1.6)",
    ),
    (lambda _: lib.Body(arms="long"), "body: arms is 'long', expected a factor"),
    (lambda w: lib.sample_fall(w.robot), f"world is a Robot, {A_WORLD}"),
    (lambda w: lib.sample_fall(w, seed=-1), "seed is -1, expected a whole number from 0"),
    (lambda w: lib.sample_fall(w, seed="a"), "seed is 'a', expected a whole number from 0"),
    (lambda w: lib.sample_fall(w, seed=1.5), "seed is 1.5, expected a whole number from 0"),
    (
        lambda w: lib.Twin(w, Fall(posture=w.robot.standing, start_class="prone")),
        "start is a Fall, expected a Posture, e.g. fall.posture",
    ),
    (
        lambda _: lib.Twin("op3"),
        "world is 'op3', expected a Robot or a World, e.g. World(robot)",
    ),
    (lambda w: lib.get_up(w, lib.StoredMotion(w, MOTION)), A_BACKEND),
    (
        lambda w: lib.get_up(lib.Twin(w), "robust"),
        "strategy is 'robust', expected a strategy, e.g. PlannedRise(world)",
    ),
    (
        lambda w: lib.get_up(lib.Twin(w), lib.PlannedRise),
        "strategy is <class 'human....PlannedRise'>, expected a strategy",
    ),
    (
        lambda w: lib.get_up(lib.Twin(w), lib.StoredMotion(w, MOTION), options={"balance": False}),
        "options is {'balance': False}, expected e.g. SessionOptions(balance=False)",
    ),
    (
        lambda w: lib.get_up(lib.Twin(w), lib.StoredMotion(w, MOTION), seed=-1),
        "seed is -1, expected a whole number from 0",
    ),
    (
        lambda w: lib.get_up(lib.Twin(w), lib.StoredMotion(w, MOTION), max_attempts="3"),
        "max_attempts is '3', expected a whole number, 1 or more",
    ),
    (lambda w: lib.keep_stand(w, w), A_BACKEND),
    (lambda w: lib.keep_stand(lib.Twin(w), w.robot), f"world is a Robot, {A_WORLD}"),
    (lambda w: lib.SafetyGuard(w), A_BACKEND),
    (
        lambda w: lib.DynamixelBackend(w.robot, ["/dev/ttyUSB0"]),
        "ports is ['/dev/ttyUSB0'], expected a device by the name of its port, e.g. "
        "{'main': '/dev/ttyUSB0'}",
    ),
    (
        lambda w: lib.OnnxPolicy.load("nope", w.robot),
        "policy file nope: No such file or directory",
    ),
    (lambda _: lib.OnnxPolicy.load("nope", "op3"), f"robot is 'op3', {A_ROBOT}"),
    (lambda _: lib.load_style("side-sit", "op3"), f"robot is 'op3', {A_ROBOT}"),
    (lambda w: lib.PlannedRise(w.robot), f"world is a Robot, {A_WORLD}"),
    (
        lambda w: lib.PlannedRise(w, search_budget="1"),
        "search_budget is '1', expected a number",
    ),
    (lambda w: lib.LearnedRise(w.robot, "robust"), f"world is a Robot, {A_WORLD}"),
    (lambda w: lib.StoredMotion(w.robot, MOTION), f"world is a Robot, {A_WORLD}"),
    (lambda _: lib.Motion.load(3), "path is 3, expected a motion file"),
    (lambda _: lib.plan("prone"), "request is 'prone', expected a PlanRequest"),
    (
        lambda _: lib.plan(lib.PreflightRequest(motion=MOTION)),
        "request is a PreflightRequest, expected a PlanRequest",
    ),
    (
        lambda _: lib.benchmark(lib.PlanRequest()),
        "request is a PlanRequest, expected a BenchRise",
    ),
]


@pytest.mark.parametrize(("call", "line"), WRONG_ARGUMENTS)
def test_an_argument_of_another_type_is_refused_in_one_line(world, call, line):
    with pytest.raises(ValueError, match=re.escape(line)) as refusal:
        call(world)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize(
    ("request_of", "line"),
    [
        (lambda: lib.PreflightRequest(motion=5), "motion is 5, expected a text"),
        (lambda: lib.EvaluateRequest(policy=5, n=4), "policy is 5, expected a text"),
        (lambda: lib.CheckRequest(robot=5), "robot is 5, expected a text"),
        (lambda: lib.TrainRequest(out=5), "--out is 5, expected a file or folder"),
        (
            lambda: lib.BuildRequest(names="squat_to_stand"),
            "names is 'squat_to_stand', expected a tuple of names",
        ),
        (lambda: lib.ClipRequest(files="a.bvh"), "files is 'a.bvh', expected a tuple of files"),
        (
            lambda: lib.ClipRequest(files=("a.bvh",), begin=math.nan),
            "--begin is nan, expected a number",
        ),
        (
            lambda: lib.ImportKeysRequest(file="a.bin", page=5),
            "--page is 5, expected a tuple of whole numbers",
        ),
        (
            lambda: lib.PlanRequest(max_checks=1.5),
            "--max-checks is 1.5, expected a whole number, 1 to 1000000000",
        ),
        (lambda: lib.PlanRequest(seed="a"), "--seed is 'a', expected a whole number, 0 to "),
        (lambda: lib.PlanRequest(seed=True), "--seed is True, expected a whole number, 0 to "),
        (lambda: lib.PlanRequest(robot=None), "--robot is None, expected a text"),
        (
            lambda: lib.PlanRequest(refinement="no"),
            "--refinement is 'no', expected True or False",
        ),
        (lambda: lib.BenchRise(assistance=math.nan), "--assistance is nan, expected 0 to 1"),
    ],
)
def test_a_field_of_another_type_is_refused_in_one_line(request_of, line):
    with pytest.raises(BadInputError, match=f"^{re.escape(line)}"):
        request_of().check()


def test_a_request_takes_a_text_for_a_path_a_path_for_a_text_and_a_list_for_a_tuple():
    assert lib.ImportRequest(model="x.urdf", out="x").model == Path("x.urdf")
    assert lib.ExtractRequest(source=Path("a.npz"), out="mine.toml").source == "a.npz"
    assert lib.ClipRequest(files=["a.bvh"]).files == (Path("a.bvh"),)
    assert lib.PlanRequest(origin="prone", key=[Path("a.json")]).key == ("a.json",)
    lib.BenchRise(assistance=1).check()


def test_the_only_port_of_a_robot_needs_no_name(op3):
    (chain,) = lib.DynamixelBackend(op3, "/dev/none").chains
    assert chain.bus.port.path == "/dev/none"


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
