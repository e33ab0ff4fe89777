"""Discovery keeps a motion only if the preflight passes it."""

import numpy as np
import pytest

from humanoid_getup.motions.motion import Motion
from humanoid_getup.motions.motion_database import load_database
from humanoid_getup.playback.preflight import Reason, ReasonKind, Verdict
from humanoid_getup.simulation.world import World
from robots import Robot
from robots.kinematics import place
from sim2real.motion_discovery import discovery
from sim2real.motion_discovery.policy_rise import PolicyRise
from sim2real.motion_discovery.replay import Replay


@pytest.mark.parametrize("passes", [True, False])
def test_what_the_preflight_refuses_is_not_kept(
    op3: Robot, monkeypatch: pytest.MonkeyPatch, passes: bool
):
    world = World(op3)
    stored = next(m for m in load_database(op3).motions if m.start_class == "supine")
    start = place(op3, world.model, stored.posture(0))
    rise = PolicyRise(start_class="supine", start=start, target=stored.joint_target, stand_time=1.0)
    replay = Replay(
        rise=rise,
        target=stored.joint_target,
        qpos=np.tile(start, (len(stored.joint_target) + 10, 1)),
        stood=np.ones(48, dtype=bool),
        stand_time=1.0,
        rms_torque=0.5,
    )
    reason = Reason(kind=ReasonKind.REFUSE, joint=None, text="too hot")
    seen: list[Motion] = []

    def check(_world: World, motion: Motion, **_options: object) -> Verdict:
        seen.append(motion)
        return Verdict(reasons=() if passes else (reason,))

    monkeypatch.setattr(discovery, "collect_rises", lambda *_: [rise])
    monkeypatch.setattr(discovery.Replayer, "play", lambda *_: replay)
    monkeypatch.setattr(discovery.Replayer, "repeat", lambda *_: replay)
    monkeypatch.setattr(discovery, "with_entries", lambda _world, motion: motion)
    monkeypatch.setattr(discovery, "preflight_stored", check)
    finder = discovery.MotionDiscovery(world, None, policy_name="robust", seed=0)  # type: ignore[arg-type]
    found = finder.search("supine", count=1, most=1)
    assert (found.learned, found.replayed, found.best_share) == (1, 1, 1.0)
    assert len(seen) == 1
    assert list(found.motions) == (seen if passes else [])
