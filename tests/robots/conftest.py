from pathlib import Path

import mujoco
import pytest
from small_humanoid import small_humanoid

from robots.model_import.anatomy import Anatomy, find_anatomy
from robots.model_import.body_plan import BodyPlan
from robots.model_import.rebuild import Rebuilder
from robots.model_import.rebuilt import SOLES, RebuiltModel, SitePlacer
from robots.model_import.source import ModelSource
from robots.model_import.tree import find_tree


@pytest.fixture(scope="session")
def anatomy() -> Anatomy:
    """The small humanoid, found in its model."""
    model, path = mujoco.MjModel.from_xml_string(small_humanoid()), Path("small.xml")
    source = ModelSource(path=path, model=model, actuators={})
    return find_anatomy(find_tree(source, []), path, [])


@pytest.fixture(scope="session")
def small(anatomy: Anatomy) -> BodyPlan:
    """The small humanoid as rebuilt, with soles."""
    builder = Rebuilder(anatomy, keep_hulls=False, fixed=(), notes=[])
    rebuilt = RebuiltModel(Path("small.xml"), "small", anatomy, builder, fixed=())
    SitePlacer(rebuilt, [], {}).add_sites()
    rebuilt.compile()
    return rebuilt.describe(SOLES)
