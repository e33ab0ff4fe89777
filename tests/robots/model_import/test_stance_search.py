"""The search for a stance: as high as it balances, arms free of the body, or a note."""

import copy
from dataclasses import replace

import numpy as np
import pytest

from robots.body.body_plan import BodyPlan
from robots.model_import.brackets import find_own_overlaps
from robots.model_import.stance_search import EXTENSIONS, find_stance


def search(small: BodyPlan) -> tuple[np.ndarray, list[str]]:
    notes: list[str] = []
    return find_stance(small, np.zeros(len(small.joint_names)), notes).joint_pos, notes


def measure_extension(small: BodyPlan, angles: np.ndarray) -> float:
    small.view.look(angles)
    leg = small.left_leg
    return float((leg.hip[2] - leg.sole_position[2]) / leg.measure_stretched())


def test_it_stands_as_high_as_it_may(small: BodyPlan):
    angles, notes = search(small)
    assert notes == []
    assert measure_extension(small, angles) == pytest.approx(EXTENSIONS[0], abs=0.03)
    assert not find_own_overlaps(small.view, angles)


def thicken(small: BodyPlan, by: float) -> BodyPlan:
    """Make the thighs' boxes wider and taller by so much to all sides [m]."""
    model = copy.copy(small.model)
    for side in ("left", "right"):
        geom = model.body(f"{side}_thigh").geomadr[0]
        model.geom_size[geom, 1:] += by
        model.geom_aabb[geom, 4:] += by
        model.geom_rbound[geom] += 2.0 * by
    return replace(small, model=model)


def test_arms_hang_further_out_beside_thick_thighs(small: BodyPlan):
    thick = thicken(small, 0.045)
    angles, _ = search(thick)
    touching = {small.model.body(b).name for p in find_own_overlaps(thick.view, angles) for b in p}
    assert not {name for name in touching if "forearm" in name}
    roll = small.joint_names.index("left_upper_arm_joint")
    assert angles[roll] > search(small)[0][roll] + 0.05


def limit(small: BodyPlan, joint: str, degrees: float) -> BodyPlan:
    """Leave the joints of a pair a narrow range about 0."""
    model = copy.copy(small.model)
    for side in ("left", "right"):
        model.jnt_range[model.joint(f"{side}_{joint}_joint").id] = np.radians([-degrees, degrees])
    return replace(small, model=model)


def test_stiff_ankles_leave_a_note_on_what_to_do(small: BodyPlan):
    stiff = limit(limit(small, "ankle", 0.5), "thigh", 0.5)
    _, notes = search(limit(stiff, "shank", 0.5))
    (note,) = notes
    assert note.startswith("no balanced stance on flat soles was found (off by ")
    assert note.endswith("write [standing] by hand, then getup robots check")
