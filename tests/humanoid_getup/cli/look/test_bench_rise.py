from pathlib import Path
from typing import Any

import pytest
from rise_figures_of import read_rises
from run_getup import Run

from humanoid_getup.benchmarks import rise
from humanoid_getup.execution.result import RiseResult


def test_interrupted_rises_are_resumed_from_their_ledger(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, run: Run
):
    ledger, whole, resumed = (tmp_path / name for name in ("ledger.json", "a.json", "b.json"))
    line = ("bench", "rise", "--n", "1", "--seed", "4", "--no-planning", "--no-filtering")
    assert run(*line, "--json", str(whole))[0] == 0
    rise_from, risen = rise.rise_from, []

    def interrupt_the_third(*args: Any, **options: Any) -> RiseResult:
        risen.append(args[1].number)
        if len(risen) == 3:
            raise KeyboardInterrupt
        return rise_from(*args, **options)

    monkeypatch.setattr(rise, "rise_from", interrupt_the_third)
    kept = (*line, "--ledger", str(ledger))
    code, _, error = run(*kept)
    assert code == 130
    assert error.splitlines()[-1].endswith(f"--ledger {ledger} --resume continues")
    code, out, _ = run(*kept, "--resume", "--json", str(resumed))
    assert code == 0
    assert "2 rises are finished" in out
    assert risen == [0, 1, 2, 2]
    assert read_rises(resumed.read_text()) == read_rises(whole.read_text())
    code, _, error = run(*kept, "--resume", "--torque-limit", "3")
    assert code == 2
    assert "made with another torque_limit_nm" in error
    code, _, error = run(*line, "--resume")
    assert code == 2
    assert "--resume is given without --ledger" in error
