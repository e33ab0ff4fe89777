"""`import humanoid_getup as hg`: what it gives, and that it costs nothing before it is used."""

import math
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from nonempty import nonempty

import humanoid_getup as hg
from drivers.dynamixel.backend import DynamixelBackend
from humanoid_getup.execution.rise import AttemptStatus, Rise
from humanoid_getup.execution.session import Session
from humanoid_getup.experiments.judging.judge import GroundTruthJudge, SensorJudge
from humanoid_getup.scenes.scene import FLAT_SCENE

LIMIT = hg.TorqueLimit(2.5, "pwm")
MOTION = "prone_push_up_gentle"


def test_importing_the_package_is_light_and_chooses_a_gl_before_mujoco():
    program = "import os, sys, humanoid_getup; print(os.environ.get('MUJOCO_GL'), *sys.modules)"
    variables = {k: v for k, v in os.environ.items() if k not in ("MUJOCO_GL", "DISPLAY")}
    done = subprocess.run(
        [sys.executable, "-c", program],
        stdout=subprocess.PIPE,
        text=True,
        check=True,
        env=variables,
    )
    gl, *modules = done.stdout.split()
    assert gl == ("egl" if sys.platform == "linux" else "None")
    heavy = {"mujoco", "numpy", "scipy", "onnxruntime", "robots.robot", "drivers"}
    assert heavy.intersection(modules) == set()


def test_every_public_name_is_there_and_is_listed():
    names = """load_robot Body World Twin DynamixelBackend SafetyGuard TorqueLimit sample_fall
        get_up keep_stand PlannedRise PlannerSettings LearnedRise StoredMotion Motion OnnxPolicy
        SessionOptions Style StyleCurves StyledRise load_style import_robot check_robot
        build_motions retarget discover import_keys import_clip extract_style plan preflight preview
        make_prior train export evaluate benchmark measure_robot rise play_motion run_policy sit
        hold watch replay_flight export_log export_motion CancelledError Progress
        ProgressMonitor import_policy check_policy identify_servo
        identify_robot"""
    requests = {name for name in hg.__all__ if name.endswith("Request") or name.startswith("Bench")}
    assert set(hg.__all__) - requests == set(names.split())
    for name in hg.__all__:
        assert getattr(hg, name).__name__ == name
    assert set(hg.__all__) <= set(dir(hg))
    with pytest.raises(AttributeError, match="has no attribute 'PlanedRise'"):
        _ = hg.PlanedRise


def test_a_world_a_fall_and_a_twin_are_what_is_named_or_given(op3, world, supine):
    assert hg.World(op3).scene.name == hg.World(op3, FLAT_SCENE).scene.name
    with pytest.raises(ValueError, match="unknown scene 'moon'"):
        hg.World(op3, "moon")
    fall = hg.sample_fall(world, "supine", seed=3)
    assert fall.start_class == "supine"
    assert np.array_equal(fall.posture.joint_pos, supine.joint_pos), "of the class and the seed"
    with pytest.raises(ValueError, match="'upside', expected supine, prone, left, right"):
        hg.sample_fall(world, "upside")
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
    guard = hg.SafetyGuard(twin)
    assert Session.on(guard, world).guard is guard, "taken as it is"


def test_a_robot_on_a_bus_is_judged_by_its_sensors_and_may_reboot_servos(op3, world):
    backend = DynamixelBackend(op3, "/dev/none")  # its only port needs no name
    assert [chain.bus.port.path for chain in backend.chains] == ["/dev/none"]
    session = Session.on(backend, world)
    assert isinstance(session.make_judge(), SensorJudge)
    assert session.services is backend


def test_a_strategy_for_another_robot_is_refused(tiny, world):
    with pytest.raises(ValueError, match="for robot 'op3', expected 'tiny' with the same joints"):
        hg.get_up(hg.Twin(tiny), hg.StoredMotion(world, MOTION))


def test_a_torque_limit_is_not_a_number(world):
    for make, given in (
        (hg.PlannerSettings, ()),
        (hg.LearnedRise, (world, "robust")),
        (hg.StoredMotion, (world, MOTION)),
    ):
        with pytest.raises(ValueError, match=r"torque_limit is 2\.5, expected a TorqueLimit, e"):
            make(*given, torque_limit=2.5)


def test_a_loaded_policy_and_its_strategy_have_one_torque_limit(op3, world):
    policy = hg.OnnxPolicy.load(op3.folder / "policies" / "robust.onnx", op3, torque_limit=2.0)
    with pytest.raises(ValueError, match=r"limit of 2\.0 N·m, expected 2\.5 N·m"):
        hg.LearnedRise(world, policy, torque_limit=LIMIT)
    assert hg.LearnedRise(world, policy, torque_limit=hg.TorqueLimit(2.0)).torque_limit.value == 2.0


WRONG = """
World('op3') | robot is 'op3', expected a Robot, e.g. load_robot('op3')
World(w.robot, 3) | scene is 3, expected a name, a .toml file or a Scene
World(w.robot, Path('x.toml')) | scene x.toml: No such file or directory
load_robot(None) | robot is None, expected a name or a folder
load_robot('op3', 'arms=1.6') | body is 'arms=1.6', expected a Body, e.g. Body(arms=1.6)
Body(arms='long') | body: arms is 'long', expected a factor
sample_fall(w.robot) | world is a Robot, expected a World, e.g. World(robot)
sample_fall(w, seed=-1) | seed is -1, expected a whole number from 0
sample_fall(w, seed='a') | seed is 'a', expected a whole number from 0
sample_fall(w, seed=1.5) | seed is 1.5, expected a whole number from 0
Twin(w, 3) | start is 3, expected a Posture, e.g. fall.posture
Twin('op3') | world is 'op3', expected a Robot or a World, e.g. World(robot)
get_up(w, stored) | backend is a World, expected a backend, e.g. Twin(world
get_up(Twin(w), 'robust') | strategy is 'robust', expected a strategy, e.g. PlannedRise(world)
get_up(Twin(w), PlannedRise) | <class 'human....PlannedRise'>, expected a strategy
get_up(Twin(w), stored, options={}) | options is {}, expected e.g. SessionOptions(balance=False)
get_up(Twin(w), stored, seed=-1) | seed is -1, expected a whole number from 0
get_up(Twin(w), stored, max_attempts='3') | is '3', expected a whole number, 1 or more
keep_stand(w, w) | backend is a World, expected a backend, e.g. Twin(world
keep_stand(Twin(w), w.robot) | world is a Robot, expected a World, e.g. World(robot)
SafetyGuard(w) | backend is a World, expected a backend, e.g. Twin(world
DynamixelBackend(w.robot, ['/dev/x']) | by the name of its port, e.g. {'main': '/dev/ttyUSB0'}
OnnxPolicy.load('nope', w.robot) | policy file nope: No such file or directory
OnnxPolicy.load('nope', 'op3') | robot is 'op3', expected a Robot, e.g. load_robot('op3')
load_style('side-sit', 'op3') | robot is 'op3', expected a Robot, e.g. load_robot('op3')
PlannedRise(w.robot) | world is a Robot, expected a World, e.g. World(robot)
PlannerSettings(search_budget='1') | search_budget is '1', expected a number
LearnedRise(w.robot, 'robust') | world is a Robot, expected a World, e.g. World(robot)
StoredMotion(w.robot, 'any') | world is a Robot, expected a World, e.g. World(robot)
StoredMotion(w, 'moonwalk') | unknown motion 'moonwalk', expected
Motion.load(3) | path is 3, expected a motion file
plan('prone') | request is 'prone', expected a PlanRequest
plan(PreflightRequest(motion='any')) | request is a PreflightRequest, expected a PlanRequest
benchmark(PlanRequest()) | request is a PlanRequest, expected a BenchRise
PreflightRequest(motion=5).check() | motion is 5, expected a text
TrainRequest(out=5).check() | --out is 5, expected a file or folder
BuildRequest(names='a').check() | names is 'a', expected a tuple of names
ClipRequest(files='a.bvh').check() | files is 'a.bvh', expected a tuple of files
ClipRequest(files=('a.bvh',), begin=nan).check() | --begin is nan, expected a number
ImportKeysRequest(file='a.bin', page=5).check() | --page is 5, expected a tuple of whole numbers
PlanRequest(max_checks=1.5).check() | --max-checks is 1.5, expected a whole number, 1 to 1000000000
PlanRequest(seed='a').check() | --seed is 'a', expected a whole number, 0 to
PlanRequest(seed=True).check() | --seed is True, expected a whole number, 0 to
PlanRequest(robot=None).check() | --robot is None, expected a text
PlanRequest(refinement='no').check() | --refinement is 'no', expected True or False
"""


def test_an_argument_of_another_type_is_refused_in_one_line(world):
    known = {name: getattr(hg, name) for name in hg.__all__}
    known |= {"w": world, "stored": hg.StoredMotion(world, MOTION), "Path": Path, "nan": math.nan}
    for call, line in (row.split(" | ") for row in nonempty(WRONG.strip().splitlines())):
        with pytest.raises(ValueError, match=re.escape(line)) as refusal:
            eval(call, known)
        assert "\n" not in str(refusal.value), call


def test_a_request_takes_a_text_for_a_path_a_path_for_a_text_and_a_list_for_a_tuple():
    assert hg.ImportRequest(model="x.urdf", out="x").model == Path("x.urdf")
    assert hg.ExtractRequest(source=Path("a.npz"), out="mine.toml").source == "a.npz"
    assert hg.ClipRequest(files=["a.bvh"]).files == (Path("a.bvh"),)
    assert hg.PlanRequest(origin="prone", key=[Path("a.json")]).key == ("a.json",)
    hg.BenchRise(search_budget=1).check()


def test_a_stored_motion_is_named_or_given(world):
    by_name = hg.StoredMotion(world, MOTION).motion
    assert by_name.name == MOTION
    assert hg.StoredMotion(world, by_name).motion is by_name


def test_a_rise_that_failed_says_so(op3):
    result = Rise(robot=op3, start_class="left", status=AttemptStatus.NEEDS_HELP, reason="no path")
    assert str(result) == "op3, left: does not stand: no path"
