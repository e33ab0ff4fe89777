"""`pytest --times 30`: the tests, files and fixtures that cost the most processor time.

Processor time of the test process and of the children that it waited for. Unlike the wall time
of `--durations`, it hardly depends on what else the machine does.
"""

import os
from collections import Counter
from collections.abc import Generator

import pytest

TEST, FIXTURE = "processor time of a test [s]", "processor time of a fixture [s]"


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--times", type=int, metavar="N", help="print the N largest processor times")


def pytest_configure(config: pytest.Config) -> None:
    if config.getoption("--times"):
        config.pluginmanager.register(ProcessorTimes(), "processor-times")


def measure_processor_s() -> float:
    """Return the seconds that this process and its finished children have computed."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


class ProcessorTimes:
    """Measures every test with its fixtures, and every fixture without those that it uses.

    A worker of pytest-xdist attaches its figures to the reports; the main process sums them.
    """

    def __init__(self) -> None:
        self.tests: Counter[str] = Counter()
        self.files: Counter[str] = Counter()
        self.fixtures: Counter[str] = Counter()
        self._properties: list[tuple[str, object]] = []
        self._nested = [0.0]  # fixtures set up inside the present one, one sum per level [s]

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Generator[None, object, object]:
        self._properties = item.user_properties
        return (yield)

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_setup(self) -> Generator[None]:
        yield from self._measure_phase()

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_call(self) -> Generator[None]:
        yield from self._measure_phase()

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_teardown(self) -> Generator[None]:
        yield from self._measure_phase()

    def _measure_phase(self) -> Generator[None]:
        start = measure_processor_s()
        try:
            yield
        finally:
            self._properties.append((TEST, measure_processor_s() - start))

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
            own = whole - self._nested.pop()
            self._nested[-1] += whole
            name = f"{fixturedef.baseid}: {fixturedef.argname}"
            self._properties.append((FIXTURE, (name, own)))

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.when != "teardown":  # its properties include those of setup and call
            return
        for name, value in report.user_properties:
            if name == TEST:
                self.tests[report.nodeid] += value
                self.files[report.nodeid.partition("::")[0]] += value
            elif name == FIXTURE:
                self.fixtures[value[0]] += value[1]

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        n = terminalreporter.config.getoption("--times")
        tables = {
            "tests": self.tests,
            "files": self.files,
            "fixtures, by themselves": self.fixtures,
        }
        for title, seconds in tables.items():
            terminalreporter.section(f"processor time of {title} [s], {seconds.total():.0f} in all")
            for name, value in seconds.most_common(n):
                terminalreporter.write_line(f"{value:8.2f}  {name}")
