"""A plan is preflighted as it is played: with feedback or without."""

import pytest

from drivers import Twin
from humanoid_getup.motions.motion_database import find_lying_down, load_database
from humanoid_getup.playback.play import MotionPlayer
from humanoid_getup.strategies import plan as plans
from humanoid_getup.strategies.plan import MotionPlan, RiseStatus
from humanoid_getup.strategies.stored_motion import StoredMotion


@pytest.mark.parametrize("simulated", [True, False])
@pytest.mark.parametrize("rises", [True, False])
@pytest.mark.parametrize("balanced", [True, False])
def test_player_preflight_and_report_agree_on_balance(
    world, op3, monkeypatch, simulated, rises, balanced
):
    rising = load_database(op3).rising[0]
    motion = rising if rises else find_lying_down(op3)
    plan = MotionPlan(
        status=RiseStatus.STORED, motion=motion, simulated=simulated, balanced=balanced
    )
    strategy = StoredMotion(world, rising)
    given = []
    monkeypatch.setattr(plans, "preflight", lambda *_, **options: given.append(options["balanced"]))
    player = MotionPlayer.__init__
    made = []

    def make(self, *args, balance=None, **options):
        made.append(balance is not None)
        player(self, *args, balance=balance, **options)

    monkeypatch.setattr(MotionPlayer, "__init__", make)
    with Twin(world) as twin:
        plan.preflight(strategy, twin.read(), twin.read)
    plan.controller(strategy)
    expected = simulated and rises and balanced
    assert given == [expected]
    assert made == [expected]
    assert plan.figures().balanced is expected
    assert (plan.open_loop() is None) is not expected
