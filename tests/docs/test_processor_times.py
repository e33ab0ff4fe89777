"""`pytest --times N` sums what workers measured, by test, file and fixture."""

from types import SimpleNamespace
from typing import Any, cast

from processor_times import FIXTURE, TEST, ProcessorTimes


def test_phases_of_a_test_and_tests_of_a_file_are_summed():
    times = ProcessorTimes()
    for name, seconds in (("one", [0.5, 1.0]), ("other", [2.0])):
        properties = [(TEST, each) for each in seconds] + [(FIXTURE, ("tests: world", 0.25))]
        for when in ("setup", "call", "teardown"):  # every report repeats what was before it
            report = SimpleNamespace(
                when=when, nodeid=f"test_a.py::{name}", user_properties=properties
            )
            times.pytest_runtest_logreport(cast("Any", report))
    assert times.tests == {"test_a.py::one": 1.5, "test_a.py::other": 2.0}
    assert times.files == {"test_a.py": 3.5}
    assert times.fixtures == {"tests: world": 0.5}
