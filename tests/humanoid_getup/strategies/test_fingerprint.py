"""The fingerprint of a plan's inputs: whatever a plan depends on changes it."""

from dataclasses import replace

from humanoid_getup.motions.motion_database import MotionDatabase, load_database
from humanoid_getup.scenes.surface import Surface
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.fingerprint import compute_fingerprint
from humanoid_getup.strategies.planned_rise import PlannedRise, PlannerOptions
from robots import Body, Robot, reshape


def _change_last(database: MotionDatabase, name: str) -> MotionDatabase:
    """Change one number of the last motion by less than a tick."""
    changed = getattr(database.motions[-1], name).copy()
    changed[-1, 0] += 1e-4
    last = replace(database.motions[-1], **{name: changed})
    return MotionDatabase([*database.motions[:-1], last], database.metric)


def test_what_a_plan_depends_on_changes_the_fingerprint(world: World, op3: Robot):
    database = load_database(op3)
    planner = PlannedRise(world, database)
    scene = world.scene
    slippery = World(op3, replace(scene, surface=Surface(friction=0.5)))
    fewer = MotionDatabase(list(database.motions[1:]), database.metric)
    known = {
        compute_fingerprint(PlannedRise(slippery, database)),
        compute_fingerprint(PlannedRise(world, fewer)),
        compute_fingerprint(PlannedRise(world, database, options=PlannerOptions(planning=False))),
        compute_fingerprint(planner),
        compute_fingerprint(PlannedRise(world, _change_last(database, "joint_target"))),
        compute_fingerprint(PlannedRise(world, _change_last(database, "joint_pos"))),
        compute_fingerprint(PlannedRise(World(reshape(op3, Body(arms=1.6))), database)),
        compute_fingerprint(PlannedRise(World(reshape(op3, Body(arms=1.7))), database)),
    }
    assert len(known) == 8
    assert compute_fingerprint(PlannedRise(World(op3))) == compute_fingerprint(planner)
