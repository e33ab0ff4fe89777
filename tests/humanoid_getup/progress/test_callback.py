"""Progress is one line, and work that is cancelled ends with its next piece."""

import threading

import pytest

from humanoid_getup.progress.callback import CancelledError, Progress, ProgressMonitor


@pytest.mark.parametrize(
    ("progress", "line"),
    [
        (Progress(phase="planning a path"), "planning a path"),
        (Progress(phase="rises", done=2, total=3), "rises 2 of 3"),
        (
            Progress(phase="varying [s]", done=7.6, total=60.0, note="9 rollouts"),
            "varying [s] 8 of 60, 9 rollouts",
        ),
        (Progress(message="found"), "found"),
    ],
)
def test_progress_is_one_line(progress: Progress, line: str):
    assert str(progress) == line


def test_work_that_is_cancelled_ends_with_the_next_piece():
    cancel = threading.Event()
    seen: list[Progress] = []
    monitor = ProgressMonitor(seen.append, cancel.is_set)
    monitor.begin("reading")
    cancel.set()
    for go_on in (lambda: monitor.tell("found"), monitor.check, lambda: monitor.begin("more")):
        with pytest.raises(CancelledError):
            go_on()
    assert [each.message for each in seen] == ["", "found", ""]
