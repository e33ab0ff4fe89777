"""Reads the figures of `getup eval --style`, and writes the tables of the confusion of styles.

    getup eval styled --n 100 --seed 13 --style long-sit,sit-up --json one.json
    python benchmarks/style_confusion.py one.json two.json

Several files, such as those of other seeds, are added up. A rise that came nearest to the curves
that it was given counts for the style that was asked for.
"""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import msgspec
import tyro

from humanoid_getup.commands.learn.evaluate import Evaluation
from humanoid_getup.experiments.falls import CLASSES
from humanoid_getup.experiments.judging.summary import PolicySummary, wilson_interval

COUNTS = ("stood", "stood_paper", "followed")


def main(files: tuple[Path, ...]) -> None:
    """Print both tables as Markdown."""
    rows: dict[str, dict[str, Counter[str]]] = {}
    for file in files:
        for case in msgspec.json.decode(file.read_bytes(), type=Evaluation).cases.values():
            asked = rows.setdefault(str(case.style), {})
            for start, found in case.classes.items():
                asked.setdefault(start, Counter()).update(_count(found, str(case.style)))
    _print_confusion({asked: sum(each.values(), Counter()) for asked, each in rows.items()})
    _print_starts(rows)


def _count(found: PolicySummary, asked: str) -> Counter[str]:
    counts = Counter({key: getattr(found, key) for key in ("n", *COUNTS)})
    for name, times in found.nearest.items():
        counts[f"near {asked if name == 'given' else name}"] += times
    return counts


def _print_confusion(rows: dict[str, Counter[str]]) -> None:
    ends = "asked nearest (95 %) | followed of those by the paper's count (95 %)"
    print(f"| asked | stood | nearest: {' | '.join(rows)} | {ends} |")
    print("|---" * (len(rows) + 4) + "|")
    for asked, row in (*rows.items(), ("all", sum(rows.values(), Counter()))):
        right = sum(rows[name][f"near {name}"] for name in ([asked] if asked in rows else rows))
        cells = [row[f"near {name}"] if asked in rows else "" for name in rows]
        cells += [_write_share(right, row["stood"])]
        cells += [_write_share(row["followed"], row["stood_paper"])]
        print(f"| `{asked}` | {row['stood']} | {' | '.join(map(str, cells))} |")


def _write_share(successes: int, n: int) -> str:
    low, high = wilson_interval(successes, n)
    return f"{successes} of {n} ({low:.0%} to {high:.0%})"


def _print_starts(rows: dict[str, dict[str, Counter[str]]]) -> None:
    print(f"\n| style: stood, by the paper's count, followed | {' | '.join(CLASSES)} | all |")
    print("|---" * (len(CLASSES) + 2) + "|")
    for asked, row in rows.items():
        each = [row[start] for start in CLASSES]
        cells = [
            f"{', '.join(str(counts[key]) for key in COUNTS)} of {counts['n']}"
            for counts in (*each, sum(each, Counter()))
        ]
        print(f"| `{asked}` | {' | '.join(cells)} |")


if __name__ == "__main__":
    main(tyro.cli(tuple[tyro.conf.Positional[Path], ...], description=__doc__))
