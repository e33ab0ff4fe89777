"""`pytest --times 30`: the tests, files and fixtures that cost the most processor time.

Processor time of the test process and of the children that it waited for. Unlike the wall time
of `--durations`, it hardly depends on what else the machine does.
"""

import os
from collections import Counter
from collections.abc import Generator

import pytest


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--times", type=int, metavar="N", help="print the N largest processor times")


def pytest_configure(config: pytest.Config) -> None:
    if config.getoption("--times"):
        config.pluginmanager.register(ProcessorTimes(), "processor-times")


def measure_processor_s() -> float:
    """Return the seconds that this process and its finished children have computed."""
    return sum(os.times()[:4])


class ProcessorTimes:
    """Measures every test with its fixtures, and every fixture without those that it uses."""

    def __init__(self) -> None:
        self.tests, self.files, self.fixtures = Counter[str](), Counter[str](), Counter[str]()
        self._nested = [0.0]  # fixtures set up inside the present one, one sum per level [s]

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Generator[None, object, object]:
        start = measure_processor_s()
        try:
            return (yield)
        finally:
            spent = measure_processor_s() - start
            self.tests[item.nodeid] += spent
            self.files[item.nodeid.partition("::")[0]] += spent

    @pytest.hookimpl(wrapper=True)
    def pytest_fixture_setup(
        self, fixturedef: pytest.FixtureDef
    ) -> Generator[None, object, object]:
        start = measure_processor_s()
        self._nested.append(0.0)
        try:
            return (yield)
        finally:
            whole = measure_processor_s() - start
            self.fixtures[f"{fixturedef.baseid}: {fixturedef.argname}"] += (
                whole - self._nested.pop()
            )
            self._nested[-1] += whole

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        n = terminalreporter.config.getoption("--times")
        tables = ("tests", self.tests), ("files", self.files), ("fixtures alone", self.fixtures)
        for title, seconds in tables:
            terminalreporter.section(f"processor time of {title} [s], {seconds.total():.0f} in all")
            for name, value in seconds.most_common(n):
                terminalreporter.write_line(f"{value:8.2f}  {name}")
