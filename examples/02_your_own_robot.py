"""Make a robot of your own from a folder: OP3 with a heavier head, still getting up."""

import shutil
import tempfile
from pathlib import Path

import numpy as np

from drivers import Twin
from humanoid_getup.execution.get_up import get_up, lay_down
from humanoid_getup.execution.rise_session import RiseSession
from humanoid_getup.motions.motion_database import load_database
from humanoid_getup.simulation.falls import sample_falls
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.plan import RiseOptions
from humanoid_getup.strategies.planned_rise import PlannedRise
from robots import load_robot


def main() -> bool:
    with tempfile.TemporaryDirectory() as folder:
        mine = Path(folder) / "heavy_head"
        shutil.copytree(load_robot("op3").folder, mine)
        model = mine / "model.xml"
        model.write_text(model.read_text().replace('mass="0.13631"', 'mass="0.25"'))

        robot = load_robot(mine)
        world = World(robot)
        rng = np.random.default_rng(2)
        fall = sample_falls(world, {"supine": 1}, rng)[0]
        planner = PlannedRise(world, load_database(robot), RiseOptions())
        twin = Twin(world)
        lay_down(world, fall, twin.place)
        result = get_up(RiseSession.on_twin(twin, world, planner), rng)
        print(f"{robot.name} of {world.model.body_mass.sum():.2f} kg: {result.reason}")
        return result.stood


if __name__ == "__main__":
    main()
