"""The real-time class: entered where it is permitted, left afterwards, and not handed on."""

import os
from typing import Any

import pytest

from drivers.real_time_class import LOOP_PRIORITY, enter_real_time_class, in_real_time_class


def find_class() -> int:
    """Return the class of this thread, without the flag for its children."""
    return os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK


@pytest.fixture
def permitted() -> None:
    with in_real_time_class() as is_in:
        if not is_in:
            pytest.skip("the system does not permit this user the real-time class")


@pytest.mark.usefixtures("permitted")
def test_a_thread_is_in_the_class_while_the_block_runs():
    before = find_class()
    with pytest.raises(RuntimeError, match="meanwhile"), in_real_time_class() as is_in:
        assert is_in
        assert find_class() == os.SCHED_FIFO
        assert os.sched_getparam(0).sched_priority == LOOP_PRIORITY
        raise RuntimeError("meanwhile")
    assert find_class() == before


@pytest.mark.usefixtures("permitted")
def test_a_thread_that_is_in_a_real_time_class_stays_as_it_is():
    with in_real_time_class(7):
        with in_real_time_class(8) as is_in:
            assert is_in
            assert os.sched_getparam(0).sched_priority == 7
        assert find_class() == os.SCHED_FIFO


def test_without_permission_a_thread_stays_where_it_is(monkeypatch: pytest.MonkeyPatch):
    def refuse(*_: object) -> None:
        raise PermissionError(1, "Operation not permitted")

    before = find_class()
    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    with in_real_time_class() as is_in:
        assert not is_in
    assert not enter_real_time_class(LOOP_PRIORITY)
    assert find_class() == before
    monkeypatch.setattr("drivers.real_time_class.IS_KNOWN", False)
    monkeypatch.delattr(os, "sched_setscheduler")  # a system without such classes
    with in_real_time_class() as is_in:
        assert not is_in


@pytest.mark.usefixtures("permitted")
def test_an_interruption_while_it_enters_leaves_it_where_it_was(monkeypatch: pytest.MonkeyPatch):
    enter = os.sched_setscheduler

    def interrupt(*values: Any) -> None:
        monkeypatch.setattr(os, "sched_setscheduler", enter)
        enter(*values)
        raise KeyboardInterrupt

    before = find_class()
    monkeypatch.setattr(os, "sched_setscheduler", interrupt)
    with pytest.raises(KeyboardInterrupt), in_real_time_class():
        pass
    assert find_class() == before
