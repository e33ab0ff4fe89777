from dataclasses import replace

import mujoco
import numpy as np
import pytest

from humanoid_getup.experiments.disturbances import Scenarios
from humanoid_getup.experiments.judging.record import join_records
from humanoid_getup.experiments.rollouts import Experiment, play
from humanoid_getup.simulation.domain_parameters import DomainParameters
from humanoid_getup.simulation.vectorized_simulation import VecSim
from humanoid_getup.simulation.world import World
from robots.kinematics import center_of_mass, place


def _stand(world: World, n: int, cycles: int) -> tuple[np.ndarray, np.ndarray]:
    robot = world.robot
    starts = np.tile(place(robot, world.model, robot.standing), (n, 1))
    return starts, np.tile(robot.standing.joint_pos, (n, cycles, 1))


def test_a_rollout_is_bit_equal_to_bare_physics(world):
    starts, targets = _stand(world, 1, 40)
    targets[0, :, :6] += np.linspace(0.0, 0.4, 40)[:, None]
    trace = play(
        world,
        Scenarios(starts=starts, parameters=DomainParameters.nominal(world, 1, limit_by="pwm")),
        targets,
    )
    model = world.model
    data = mujoco.MjData(model)
    data.qpos[:] = starts[0]
    for row in targets[0]:
        data.ctrl[:] = row
        mujoco.mj_step(model, data, 4)
    np.testing.assert_array_equal(trace.qpos[0, -1], data.qpos)


def test_a_rollout_does_not_depend_on_those_before_it(world):
    starts, targets = _stand(world, 1, 60)
    targets[0, :, :6] += np.linspace(0.0, 0.4, 60)[:, None]
    nominal = DomainParameters.nominal(world, 1)
    alone = play(world, Scenarios(starts=starts, parameters=nominal), targets)
    used = Experiment(world)
    diverging = np.where(np.arange(60)[:, None] < 30, targets, np.nan)
    heavy = replace(nominal, mass=1.3 * nominal.mass, armature=2.0 * nominal.armature)
    for before, parameters in ((-targets, nominal), (diverging, nominal), (targets, heavy)):
        used.play(Scenarios(starts=starts, parameters=parameters), before)
        again = used.play(Scenarios(starts=starts, parameters=nominal), targets)
        np.testing.assert_array_equal(again.qpos, alone.qpos)
        np.testing.assert_array_equal(again.torque, alone.torque)


@pytest.mark.parametrize("sizes", [(1, 2, 57)])
def test_targets_may_come_in_pieces_of_any_size_also_into_a_given_simulation(world, sizes):
    starts, targets = _stand(world, 2, 60)
    targets[0, :, :6] += np.linspace(0.0, 0.4, 60)[:, None]
    scenarios = Scenarios.nominal(world, starts)
    whole = play(world, scenarios, targets)
    pieces = iter(np.split(targets, np.cumsum(sizes)[:-1], axis=1))
    experiment = Experiment(world, sim=VecSim(world, 2))
    records = list(experiment.play_pieces(scenarios, lambda: next(pieces, None)))
    assert [record.qpos.shape[1] for record in records] == list(sizes)
    joined = join_records(records)
    for name in ("qpos", "torque", "target", "upright"):
        np.testing.assert_array_equal(getattr(joined, name), getattr(whole, name))


def test_feedback_sees_the_robot_and_its_targets_are_recorded(world):
    starts, targets = _stand(world, 1, 5)
    robot, seen = world.robot, []
    torso = robot.layout(world.model).torso
    p = robot.standing
    expected = center_of_mass(
        robot, world.model, p.position[None], p.orientation[None], p.joint_pos[None]
    )[0]

    def steer(observation):
        if observation.step == len(targets[0]):
            return None
        assert observation.joint_pos == pytest.approx(targets[:, 0], abs=0.01)
        seen.append(
            (observation.step, observation.limb_touch.sum(), observation.com[0, torso].copy())
        )
        return targets[:, observation.step] + 0.01

    trace = play(
        world, Scenarios(starts=starts, parameters=DomainParameters.nominal(world, 1)), steer
    )
    assert [step for step, *_ in seen] == [0, 1, 2, 3, 4]
    for _, _, com in seen:  # the first time, too
        np.testing.assert_allclose(com, expected, atol=1e-3)
    assert seen[-1][1] == 2  # both legs touch the ground, no other limb
    np.testing.assert_allclose(trace.target, targets + 0.01)
