"""TOML files for people to edit: aligned rows, comments, short numbers."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise

import tomlkit
from tomlkit.items import AoT, Array, InlineTable, Item, Table

Value = str | bool | int | float | Item | Sequence["Value"] | Mapping[str, "Value"]


def commented(value: Value, comment: str) -> Item:
    """Return a value with a comment behind it."""
    return tomlkit.item(value).comment(comment)


def in_line(values: Mapping[str, Value]) -> InlineTable:
    """Return a table in one line, and those within it."""
    table = tomlkit.inline_table()
    for key, value in values.items():
        table.append(key, in_line(value) if isinstance(value, Mapping) else value)
    return table


def one_a_line(rows: Iterable[Mapping[str, Value]], *, in_columns: bool = False) -> Array:
    """Return tables, one in each line; in columns, the same keys stand below each other.

    The columns are those of the keys that all rows begin with.
    """
    tables = [in_line(row) for row in rows]
    if in_columns:
        _align(tables)
    lines = tomlkit.array().multiline(True)
    lines.extend(tables)
    return lines


def _align(tables: Sequence[InlineTable]) -> None:
    """Set spaces in front of keys so that each has its column."""
    rows = [{key.key: item for key, item in table.value.body if key} for table in tables]
    keys = [*rows[0]] if rows else []
    for before, key in pairwise(keys):
        if not all(before in row and key in row for row in rows):
            continue
        widths = [len(row[before].as_string()) for row in rows]
        for row, width in zip(rows, widths, strict=True):
            row[key].trivia.indent = " " * (max(widths) - width)


def table_of(values: Mapping[str, Value], *comments: str) -> Table:
    """Return a table with comments under its head."""
    table = tomlkit.table()
    for comment in comments:
        table.add(tomlkit.comment(comment))
    for key, value in values.items():
        table.add(key, value)
    return table


def tables_of(rows: Iterable[Mapping[str, Value]]) -> AoT:
    """Return tables that each have a head, ``[[name]]``."""
    tables = tomlkit.aot()
    for row in rows:
        tables.append(table_of(row))
    return tables


def plain(value: float, decimals: int) -> int | float:
    """Round a number; whole ones are written without a point."""
    number = round(float(value), decimals)
    return int(number) if number.is_integer() else number


def rounded(value: float, digits: int) -> int | float:
    """Round to significant digits; whole numbers are written without a point."""
    number = float(f"{value:.{digits}g}")
    return int(number) if number.is_integer() else number
