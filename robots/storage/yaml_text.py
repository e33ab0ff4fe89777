"""YAML as plain values, of a limited size; no code in it is run."""

from __future__ import annotations

from typing import Any

from robots.storage.files import describe
from robots.storage.validation import MAX_TEXT

PYTHON_TAG = "tag:yaml.org,2002:python/"
MOST_NODES = MAX_TEXT // 2  # as many values as a file can hold without aliases


def parse_yaml(text: str) -> Any:
    """Read the first document of a text, None if it has none; raise `ValueError` if it is no YAML.

    Tagged Python objects are kept as the lists, tables or texts that they tag.
    """
    import yaml

    base = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
    own: Any = type("PlainLoader", (base,), {})
    own.add_multi_constructor(PYTHON_TAG, _construct_plainly)
    loader = own(text)
    try:
        if not loader.check_node():
            return None
        node = loader.get_node()
        loader.check_node()  # which raises unless the text ends, or another document begins
        if _count_nodes(node, {}) > MOST_NODES:
            raise ValueError("its aliases stand for too many values")
        return loader.construct_document(node)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark
        place = f"line {mark.line + 1}: " if mark else ""
        raise ValueError(f"{place}{error.problem}") from error
    except (yaml.YAMLError, TypeError) as error:
        raise ValueError(describe(error)) from error
    finally:
        loader.dispose()


def _count_nodes(node: Any, known: dict[int, int]) -> int:
    """Count the values in a node, each as often as aliases repeat it."""
    if isinstance(node.value, str):
        return 1
    if id(node) not in known:
        known[id(node)] = MOST_NODES + 1  # if it is met again within itself
        rows = [item if isinstance(item, tuple) else (item,) for item in node.value]
        known[id(node)] = 1 + sum(_count_nodes(part, known) for row in rows for part in row)
    return known[id(node)]


def _construct_plainly(loader: Any, _suffix: str, node: Any) -> Any:
    import yaml

    if isinstance(node, yaml.SequenceNode):
        return loader.construct_sequence(node, deep=True)
    if isinstance(node, yaml.MappingNode):
        return loader.construct_mapping(node, deep=True)
    return loader.construct_scalar(node)
