"""mujoco-warp moves robots as MuJoCo does, world by world; what it lacks is counted and said."""

import mujoco
import numpy as np
import pytest

pytest.importorskip("mujoco_warp", reason="needs the `warp` extra: make test-warp")

from humanoid_getup.simulation import warp_batch
from humanoid_getup.simulation.domain_parameters import DomainParameters
from humanoid_getup.simulation.physics_engine import MUJOCO, PhysicsEngine
from humanoid_getup.simulation.vectorized_simulation import VecSim
from humanoid_getup.simulation.warp_batch import Room, WarpBatch
from humanoid_getup.simulation.world import World
from robots import Robot
from robots.kinematics import place

pytestmark = pytest.mark.warp
WARP = PhysicsEngine("warp", "cpu")
STEPS = 100  # 0.2 s
DIFFERENCES = {
    "mass": 1.3,
    "friction": 0.05,
    "torque_limit": 1.0,
    "armature": 8.0,
    "friction_loss": 4.0,
    "com_shift": 0.02,
}


def fall_back(
    robot: Robot, physics: PhysicsEngine, world: World, parameters: DomainParameters
) -> VecSim:
    """Bow deeply where the servos are strong enough; it ends on the knees or the face."""
    sim = VecSim(world, parameters.n, threads=1, physics=physics)
    sim.set_parameters(sim.everyone, parameters)
    sim.place(sim.everyone, np.tile(place(robot, world.model, robot.standing), (sim.n, 1)))
    bent = robot.standing.joint_pos + 0.6
    sim.hold(np.tile(np.clip(bent, robot.lower, robot.upper), (sim.n, 1)), STEPS)
    return sim


def vary_each(world: World) -> DomainParameters:
    """One nominal robot, and one more that differs in each parameter."""
    parameters = DomainParameters.nominal(world, 1 + len(DIFFERENCES))
    for row, (name, value) in enumerate(DIFFERENCES.items(), start=1):
        getattr(parameters, name)[row] = value
    return parameters


@pytest.fixture(scope="module")
def both(op3: Robot, world: World) -> tuple[VecSim, VecSim]:
    varied = vary_each(world)
    return tuple(fall_back(op3, physics, world, varied) for physics in (MUJOCO, WARP))


def test_a_robot_moves_as_in_mujoco(both):
    mujoco_sim, warp_sim = both
    moved = np.abs(mujoco_sim.qvel[0]).max()
    assert moved > 0.5
    assert warp_sim.qpos[0] == pytest.approx(mujoco_sim.qpos[0], abs=1e-4)
    assert warp_sim.torque[0] == pytest.approx(mujoco_sim.torque[0], abs=0.02)
    assert not warp_sim.diverged.any()


@pytest.mark.parametrize("row", range(1, 1 + len(DIFFERENCES)), ids=DIFFERENCES)
def test_a_domain_parameter_changes_a_world_as_it_does_in_mujoco(both, row: int):
    by_mujoco, by_warp = (sim.qpos[row] - sim.qpos[0] for sim in both)
    size = np.linalg.norm(by_mujoco)
    assert size > 1e-3
    assert np.linalg.norm(by_warp - by_mujoco) < 0.05 * size


def test_worlds_that_are_not_stepped_stay_as_they_are(op3: Robot, world: World):
    sim = VecSim(world, 3, physics=WARP)
    sim.place(sim.everyone, np.tile(place(op3, world.model, op3.standing), (3, 1)))
    before, torque = sim.batch.state.copy(), sim.torque
    sim.hold(op3.standing.joint_pos[None] + 0.3, 5, np.array([1]))
    changed = np.any(sim.batch.state != before, axis=1)
    assert changed.tolist() == [False, True, False]
    assert np.any(sim.torque != torque, axis=1).tolist() == [False, True, False]


def lie(world: World, op3: Robot, n: int) -> np.ndarray:
    """Robots on their backs, which have more contacts than standing ones."""
    qpos = np.tile(place(op3, world.model, op3.standing), (n, 1))
    layout = op3.layout(world.model)
    qpos[:, layout.root_orientation] = [np.sqrt(0.5), 0.0, -np.sqrt(0.5), 0.0]
    qpos[:, layout.root_qpos + 2] = 0.08
    return qpos


def fall_in_little_room(
    monkeypatch: pytest.MonkeyPatch, op3: Robot, world: World, room: Room, growth: int
) -> VecSim:
    monkeypatch.setattr(warp_batch.Room, "of", lambda _: room)
    monkeypatch.setattr(warp_batch, "MOST_GROWTH", growth)
    sim = VecSim(world, 2, physics=WARP)
    sim.place(sim.everyone, lie(world, op3, 2))
    sim.hold(np.tile(op3.standing.joint_pos, (2, 1)), 30)
    return sim


@pytest.mark.parametrize(
    ("room", "warning"),
    [
        (Room(contacts=64, rows=24), mujoco.mjtWarning.mjWARN_CNSTRFULL),
        (Room(contacts=2, rows=256), mujoco.mjtWarning.mjWARN_CONTACTFULL),
    ],
    ids=["constraints", "contacts"],
)
def test_a_world_without_room_for_its_contacts_has_diverged(
    op3: Robot, world: World, monkeypatch: pytest.MonkeyPatch, room: Room, warning: int
):
    with pytest.warns(RuntimeWarning, match=r"2 of 2 worlds lacked room for their contacts"):
        sim = fall_in_little_room(monkeypatch, op3, world, room, growth=1)
    assert sim.diverged.all()
    assert np.all(sim.batch.warning[:, warning, 1] == 1)


def test_room_that_is_lacking_is_made_and_nothing_is_lost(
    op3: Robot, world: World, monkeypatch: pytest.MonkeyPatch
):
    ample = VecSim(world, 2, physics=WARP)
    ample.place(ample.everyone, lie(world, op3, 2))
    ample.hold(np.tile(op3.standing.joint_pos, (2, 1)), 30)
    room = Room(contacts=64, rows=24)
    grown = fall_in_little_room(monkeypatch, op3, world, room, growth=64)
    assert not grown.diverged.any()
    assert grown.qpos == pytest.approx(ample.qpos, abs=1e-6)


@pytest.mark.parametrize("bad", [np.nan, 1e12])
def test_only_a_robot_whose_physics_fails_has_diverged(
    op3: Robot, world: World, bad: float, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)  # where MuJoCo writes its log
    sim = VecSim(world, 3, physics=WARP)
    targets = np.tile(op3.standing.joint_pos, (3, 2, 1))
    sim.place(sim.everyone, np.tile(place(op3, world.model, op3.standing), (3, 1)))
    sim.read("qvel")[1, 1] = bad
    played = sim.advance(targets, 2, ("qpos",))
    assert sim.diverged.tolist() == [False, True, False]
    assert np.isfinite(sim.qpos).all() and np.isfinite(played["qpos"]).all()
    sim.advance(targets, 2)
    assert not sim.diverged.any()


def test_a_model_that_mujoco_warp_cannot_simulate_is_refused_by_what_it_has(world: World):
    model = world.vary().model
    model.opt.solver = mujoco.mjtSolver.mjSOL_PGS
    with pytest.raises(ValueError, match="mujoco-warp cannot simulate this model: mjSOL_PGS"):
        WarpBatch(model, 1, device="cpu")
