"""ToddlerBot as loaded: its facts, its waist's differential, and standing on its servos."""

import json

import numpy as np
import pytest
from paths import SHARED

from drivers import Command, SafetyGuard, Twin
from drivers.servo_units import ServoUnits
from humanoid_getup.experiments.disturbances import Scenarios
from humanoid_getup.experiments.judging.standing import HOLD_TIME, MAX_TILT, is_upright
from humanoid_getup.experiments.rollouts import play
from humanoid_getup.motions.motion import Motion
from humanoid_getup.motions.optimization import SWAY_TIME
from humanoid_getup.simulation.domain_parameters import DomainParameters
from humanoid_getup.simulation.world import World
from robots import Robot, load_robot, quaternion
from robots.kinematics import place

FACTS = SHARED / "robots" / "toddlerbot.json"


@pytest.fixture(scope="module")
def toddlerbot() -> Robot:
    return load_robot("toddlerbot")


@pytest.fixture(scope="module")
def facts() -> dict:
    if not FACTS.exists():
        pytest.skip("the robot facts (shared/robots/toddlerbot.json) are not beside this checkout")
    return json.loads(FACTS.read_text("utf-8"))


def test_ranges_ids_gains_and_gears_are_those_of_the_facts(toddlerbot: Robot, facts: dict):
    joints = {joint["name"]: joint for joint in facts["joints"]}
    gears = {each["driven"]: each for each in facts["gear_couplings"]}
    renamed = {"waist_yaw": "waist_act_1", "waist_roll": "waist_act_2"}
    for joint in toddlerbot.joints:
        driven = joints.get(joint.name) or joints[f"{joint.name}_driven"]
        gear = gears.get(driven["name"], {"motor": None, "ratio": 1.0})
        motor = gear["motor"] or renamed.get(joint.name, joint.name)
        motor = "neck_pitch_act" if joint.name == "neck_pitch" else motor
        assert (joint.lower, joint.upper) == pytest.approx(driven["range_rad"], abs=1e-5)
        assert joint.servo.id == joints[motor]["motor_id"]
        assert joint.servo.p_gain == joints[motor]["kp_raw"]
        assert joint.servo.model.name.startswith(joints[motor]["servo_2xc"])
        assert joint.servo.gear * abs(gear["ratio"]) == pytest.approx(1.0, abs=1e-4)
    assert sorted(joint.servo.id for joint in toddlerbot.joints) == list(range(30))


def test_both_servos_of_the_waist_turn_it(toddlerbot: Robot):
    """The facts: yaw = 0.20833 (m1 + m2), roll = -0.29167 (m1 - m2)."""
    yaw, roll = (toddlerbot.joint_names.index(name) for name in ("waist_yaw", "waist_roll"))
    units, angles = ServoUnits(toddlerbot), toddlerbot.standing.joint_pos.copy()
    angles[yaw], angles[roll] = 0.3, -0.2
    turn = 2.0 * np.pi / 4096
    m1, m2 = (units.to_ticks(angles)[[yaw, roll]] - 2048) * turn
    assert 0.20833 * (m1 + m2) == pytest.approx(0.3, abs=turn)
    assert -0.29167 * (m1 - m2) == pytest.approx(-0.2, abs=turn)


def test_it_stands_for_three_seconds_and_turns_its_waist(toddlerbot: Robot):
    target, yaw = toddlerbot.standing.joint_pos.copy(), toddlerbot.joint_names.index("waist_yaw")
    target[yaw] = 0.3
    twin = Twin(toddlerbot)
    with SafetyGuard(twin) as guard:
        for cycle in range(300):
            guard.read()
            goal = toddlerbot.standing.joint_pos if cycle < 150 else target
            guard.write(Command.position(toddlerbot, goal))
        state = guard.read()
    tilt = np.arccos(-quaternion.gravity_in_body(twin.truth.posture.orientation)[2])
    assert tilt < MAX_TILT
    assert state.joint_pos[yaw] == pytest.approx(0.3, abs=0.03)


@pytest.mark.parametrize(
    "name",
    [
        "supine_found_1",
        *(pytest.param(f"{side}_found_1", marks=pytest.mark.slow) for side in ("prone", "left")),
    ],
)
def test_its_stored_motions_end_in_a_held_stand(toddlerbot: Robot, name: str):
    motion = Motion.load(toddlerbot.folder / "motions" / f"{name}.npz")
    world, length = World(toddlerbot), motion.duration + SWAY_TIME + HOLD_TIME
    targets = motion.sample(np.arange(0.0, length, toddlerbot.control_period))
    start = place(toddlerbot, world.model, motion.posture(0))
    trace = play(
        world,
        Scenarios(starts=start[None], parameters=DomainParameters.nominal(world, 1)),
        targets[None],
    )
    stance = trace.stance
    assert stance.neck_height[0, 0] < 0.85 * toddlerbot.standing_neck_height
    held = round(HOLD_TIME / toddlerbot.control_period)
    assert is_upright(stance, toddlerbot)[0, -held:].all()
