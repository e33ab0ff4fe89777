"""The policy runner: what it refuses, how it moves, when it stops."""

from pathlib import Path

import numpy as np
import pytest
from nonempty import nonempty

pytest.importorskip("onnx")

from bus_stories import TINY, copy_tiny
from tiny_policies import actions_of, contract_of, save_policy, state_of, weights_of

from drivers import Ending, GuardLimits, SafetyGuard, State, Twin, run
from humanoid_getup.experiments.falls import sample_falls
from humanoid_getup.policy.action import next_target
from humanoid_getup.policy.observation import observe
from humanoid_getup.policy.onnx_policy import LONGEST, OnnxPolicy, PolicyError
from humanoid_getup.scenes.scene import FLAT_SCENE
from humanoid_getup.simulation.world import World
from robots import Robot, load_robot, quaternion
from sim2real.environment.training_simulation import TrainingSim
from sim2real.environment.training_world import build_training_world

PERIOD = 0.008


@pytest.fixture(scope="module")
def tiny() -> Robot:
    return load_robot(TINY)


def begin(file: Path, robot: Robot, state: State | None = None, **options) -> OnnxPolicy:
    policy = OnnxPolicy.load(file, robot, PERIOD, **options)
    policy.reset(state or state_of(robot))
    return policy


def test_every_mismatch_of_contract_and_network_is_reported_at_once(tiny: Robot, tmp_path: Path):
    contract = contract_of(tiny, robot="nao", mode="torque", imu_frame="askew").to_json()
    file = save_policy(tmp_path / "p.onnx", tiny, weight=np.zeros((5, 3)), contract=contract)
    with pytest.raises(PolicyError) as refusal:
        OnnxPolicy.load(file, tiny, 0.01)
    begins = ["robot", "action mode", "rate", "IMU frame", "network input", "network output"]
    assert [problem.split(":")[0] for problem in refusal.value.problems] == begins
    assert str(file) in str(refusal.value)
    assert all(problem in str(refusal.value) for problem in refusal.value.problems)


def test_a_file_that_holds_no_policy_is_refused(tiny: Robot, tmp_path: Path):
    """Truncated, without a contract, with one that is none, with weights that are no numbers."""
    content = save_policy(tmp_path / "p.onnx", tiny).read_bytes()
    for share in (0.0, 0.3, 0.9):
        (tmp_path / "p.onnx").write_bytes(content[: int(share * len(content))])
        refuse(tmp_path, tiny, r"not a complete ONNX file|no policy contract|damaged")
    save_policy(tmp_path / "p.onnx", tiny, contract=None)
    refuse(tmp_path, tiny, "has no policy contract: export it with")
    save_policy(tmp_path / "p.onnx", tiny, contract='{"format": 5}')
    refuse(tmp_path, tiny, r"robot is missing.*action is missing")
    for value in (np.nan, np.inf):
        save_policy(tmp_path / "p.onnx", tiny, weight=weights_of(tiny, gyro=value))
        refuse(tmp_path, tiny, "returns NaN or infinity")


def refuse(folder: Path, robot: Robot, message: str) -> None:
    with pytest.raises(PolicyError, match=message):
        OnnxPolicy.load(folder / "p.onnx", robot, PERIOD)


def test_it_decides_once_in_six_cycles_and_moves_evenly_between(tiny: Robot, tmp_path: Path):
    """The action is the speed of the joints; only that at the decisions counts."""
    weight = weights_of(tiny, joint_vel=0.5)  # (0.5 + 0.5) times the speed of both
    policy = begin(save_policy(tmp_path / "p.onnx", tiny, weight=weight), tiny)
    speeds = [0.2, 9.0, 9.0, 9.0, 9.0, 9.0, -0.4, 9.0, 9.0, 9.0, 9.0, 9.0]
    sent = [
        policy.step(state_of(tiny, k * PERIOD, joint_vel=np.full(2, speed))).joint_pos
        for k, speed in enumerate(speeds)
    ]
    calm = policy.action.calm.least * policy.action.scale
    way = np.cumsum([0.2 / 6] * 6 + [-0.4 / 6] * 6)[:, None] * calm * actions_of(tiny).directions[0]
    np.testing.assert_allclose(sent, tiny.standing.joint_pos + way, atol=1e-7)


def test_a_torque_limit_caps_the_command_and_is_observed_by_the_network(
    tiny: Robot, tmp_path: Path
):
    file = save_policy(tmp_path / "p.onnx", tiny, weight=weights_of(tiny, torque_share=0.2))
    for limit, share in ((None, 1.0), (0.5 * tiny.max_torque.max(), 0.5), (99.0, 1.0)):
        policy = begin(file, tiny, torque_limit=limit)
        command = policy.step(state_of(tiny))
        np.testing.assert_allclose(command.torque_limit, share * tiny.max_torque)
        moved = command.joint_pos - tiny.standing.joint_pos
        calm = policy.action.calm.least * policy.action.scale
        step = 0.2 * share * calm * actions_of(tiny).directions[0]
        np.testing.assert_allclose(moved, step / 6, rtol=1e-6)


def askew_robot(folder: Path) -> Robot:
    """The smallest robot, its IMU turned by 90 deg about x and then 30 deg about z."""
    mine = copy_tiny(folder)
    model = mine / "model.xml"
    turned = model.read_text().replace('name="imu"', 'name="imu" euler="90 0 30"')
    model.write_text(turned)
    return load_robot(mine)


@pytest.mark.parametrize("askew", [False, True])
def test_one_log_gives_training_and_robot_the_same_numbers(tmp_path: Path, askew: bool):
    """Six robots in other postures, seen by the sim's sensors and as measurements of one."""
    robot = askew_robot(tmp_path) if askew else load_robot("op3")
    action = actions_of(robot)
    sim = TrainingSim(
        build_training_world(robot, FLAT_SCENE, 0.004), 6, cycles=action.cycles, threads=1
    )
    rng = np.random.default_rng(4)
    qpos, qvel = sim.qpos, rng.normal(size=sim.qvel.shape)
    qpos[:, 2] = 1.0
    qpos[:, 3:7] = quaternion.normalize(rng.normal(size=(6, 4)))
    qpos[:, 7:] = rng.uniform(-0.5, 0.5, size=qpos[:, 7:].shape)
    sim.place(np.arange(6), qpos, qvel)
    sensed = sim.sense()
    last, share = np.zeros((6, action.size)), np.ones((6, 1))
    seen = observe(robot, sensed, sensed.joint_pos, last, share)
    raw = sim.batch.bind("sensordata")
    gyro, orientation = (sim.model.sensor(f"imu_{name}").adr[0] for name in ("gyro", "orientation"))
    policy = OnnxPolicy.load(save_policy(tmp_path / "p.onnx", robot), robot, PERIOD)
    for i in range(6):
        state = state_of(
            robot,
            joint_pos=sensed.joint_pos[i],
            joint_vel=sensed.joint_vel[i],
            gyro=raw[i, gyro : gyro + 3],
            orientation=raw[i, orientation : orientation + 4],
        )
        policy.reset(state)
        np.testing.assert_allclose(policy.observe(policy.sense(state)), seen[i], atol=1e-6)


def test_the_targets_between_decisions_are_those_of_training(op3: Robot, tmp_path: Path):
    """Targets of the sim's servos at the end of each cycle of two policy steps."""
    action = actions_of(op3)
    sim = TrainingSim(
        build_training_world(op3, FLAT_SCENE, 0.004), 1, cycles=action.cycles, threads=1
    )
    qpos = sim.qpos
    qpos[:, 2] += 1.0  # in the air
    sim.place(np.array([0]), qpos)
    bias = np.linspace(-1.5, 1.5, action.size)
    file = save_policy(tmp_path / "p.onnx", op3, bias=bias)
    target = measured = sim.sense().joint_pos
    policy = begin(file, op3, state_of(op3, joint_pos=measured[0]))
    for step in range(2):
        sensed = sim.sense()
        measured = sensed.joint_pos
        following = next_target(op3, action, target, measured, sensed.gravity, np.float32(bias))
        message = sim.follow(target, following, record=("ctrl",))["ctrl"]
        target = following
        for cycle in nonempty(range(action.cycles)):
            time = (step * action.cycles + cycle) * PERIOD
            command = policy.step(state_of(op3, time, joint_pos=measured[0]))
            np.testing.assert_allclose(command.joint_pos, message[0, cycle], atol=1e-6)


def test_a_network_that_loses_its_numbers_makes_the_robot_limp_for_good(
    tiny: Robot, tmp_path: Path
):
    """The root of the joints' speed is no number where that is negative."""
    weight = weights_of(tiny, joint_vel=1.0)
    policy = begin(save_policy(tmp_path / "p.onnx", tiny, weight=weight, then=("Sqrt",)), tiny)
    states = [state_of(tiny, k * PERIOD, joint_vel=np.full(2, -1.0)) for k in range(1, 12)]
    assert not policy.step(state_of(tiny)).is_limp
    sent = [policy.step(state) for state in states]
    assert [command.is_limp for command in sent] == [False] * 5 + [True] * 6
    assert policy.done
    assert policy.failure == "the network returns NaN or infinity: l_hip together"
    policy.reset(state_of(tiny))
    assert (policy.done, policy.failure) == (False, None)


@pytest.mark.parametrize(("lean", "speed"), [(0.35, 0.0), (0.0, 2.0)], ids=["leans", "swings"])
def test_a_robot_that_does_not_stand_still_has_its_time(tiny: Robot, tmp_path: Path, lean, speed):
    leaning = quaternion.from_axis_angle(np.array([0.0, 1.0, 0.0]), lean)
    weight = weights_of(tiny, joint_vel=0.25)
    policy = begin(save_policy(tmp_path / "p.onnx", tiny, weight=weight), tiny)
    k = 0
    while not policy.done:
        swing = np.full(2, speed * (-1.0) ** (k // 6))
        policy.step(state_of(tiny, k * PERIOD, orientation=leaning, joint_vel=swing))
        k += 1
    assert (k - 1) * PERIOD == pytest.approx(LONGEST, abs=PERIOD)


def test_the_guard_never_has_to_cut_a_policy(world: World, tmp_path: Path):
    """A policy that is out of its mind: sines of large numbers, beyond 1 by half."""
    robot = world.robot
    weight = np.random.default_rng(0).normal(size=weights_of(robot).shape, scale=30.0)
    file = save_policy(tmp_path / "p.onnx", robot, weight=weight, then=("Sin", "Asinh"))
    fall = sample_falls(world, {"supine": 1}, np.random.default_rng(3))[0]
    twin = Twin(world)
    twin.place(fall.posture)
    guard = SafetyGuard(twin, GuardLimits.of(robot))
    policy = OnnxPolicy.load(file, robot, PERIOD, longest=2.5)
    moved = []
    report = run(
        policy, guard, max_time=9.0, on_cycle=lambda cycle: moved.append(cycle.asked.joint_pos)
    )
    assert report.ending is Ending.DONE
    assert report.clips.total == 0
    speed = np.abs(np.diff(moved, axis=0)).max(axis=0) / PERIOD
    knee = robot.joint_names.index("l_knee")
    assert speed[knee] > 0.9 * robot.max_velocity[knee]


def test_a_policy_that_begins_again_remembers_nothing_of_its_first_run(tiny: Robot, tmp_path: Path):
    """Its next action depends on its last ones; those of an earlier run are none of them."""
    weight, file = weights_of(tiny, last_action=0.5, joint_pos=0.3), tmp_path / "p.onnx"
    save_policy(file, tiny, weight=weight, bias=0.2, then=("Tanh",))
    policy = OnnxPolicy.load(file, tiny, PERIOD)

    def run_once() -> list[list[float]]:
        policy.reset(state_of(tiny))
        steps = [policy.step(state_of(tiny, time=k * PERIOD)) for k in range(60)]
        return [command.joint_pos.tolist() for command in steps]

    first = run_once()
    assert first[0] != first[-1], "its memory changes what it does"
    assert run_once() == first
