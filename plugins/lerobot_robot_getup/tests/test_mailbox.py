"""The mailbox: an action is answered by the cycle that sent it, and dropped during a rise."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from getup_server.mailbox import Mailbox
from getup_server.messages import Snapshot


def measure(mailbox: Mailbox, value: float) -> None:
    """Publish a cycle whose only joint is at a value."""
    joint = np.array([value])
    mailbox.measure(joint_pos=joint, targets=joint, gravity_b=joint[:0], gyro_b=joint[:0])


@pytest.fixture
def mailbox() -> Mailbox:
    zero = np.zeros(1)
    return Mailbox(Snapshot(joint_pos=zero, targets=zero, gravity_b=zero[:0], gyro_b=zero[:0]))


def test_an_action_is_answered_by_the_cycle_that_sent_it_not_by_a_later_one(mailbox: Mailbox):
    with ThreadPoolExecutor(1) as pool:
        for i in range(1, 51):
            answer = pool.submit(mailbox.post, {"knee": float(i)})
            while mailbox.take() != {"knee": float(i)}:
                pass
            for later in range(5):
                measure(mailbox, i + 0.1 * later)
            assert answer.result().targets.item() == i
            assert mailbox.snapshot.targets.item() == pytest.approx(i + 0.4)


@pytest.mark.parametrize("when", ["before", "meanwhile"])
def test_actions_of_the_time_of_a_rise_are_dropped(when: str, mailbox: Mailbox):
    with ThreadPoolExecutor(1) as pool:
        if when == "before":
            answer = pool.submit(mailbox.post, {"knee": 1.0})
            mailbox.wait()
        mailbox.begin("falling", rising=True)
        if when == "meanwhile":
            answer = pool.submit(mailbox.post, {"knee": 1.0})
        assert answer.result().rising
        mailbox.begin("obeying", rising=False)
        assert mailbox.take() == {}
