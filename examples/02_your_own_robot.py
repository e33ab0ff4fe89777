"""A robot of your own, from a folder: an OP3 with a heavier head still gets up."""

import shutil
import tempfile
from pathlib import Path

import humanoid_getup as hg

with tempfile.TemporaryDirectory() as folder:
    mine = Path(folder) / "heavy_head"
    shutil.copytree(hg.load_robot("op3").folder, mine)
    model = mine / "model.xml"
    model.write_text(model.read_text().replace('mass="0.13631"', 'mass="0.25"'))

    world = hg.World(hg.load_robot(mine))
    fall = hg.sample_fall(world, "supine", seed=2)
    result = hg.get_up(hg.Twin(world, fall.posture), hg.PlannedRise(world))

print(f"{world.model.body_mass.sum():.2f} kg; {result}")
