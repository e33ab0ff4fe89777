"""Finds tests that would pass if a collection were empty: they assert only of all its items."""

import ast
from collections.abc import Iterator
from pathlib import Path

WRAPPERS = {"enumerate", "zip", "reversed", "sorted", "product", "pairwise"}


def find_unsure_tests(file: Path) -> list[str]:
    """Name the tests of a file that assert, but only in loops that may have no iteration."""
    nodes = ast.walk(ast.parse(file.read_text("utf-8")))
    return [
        node.name
        for node in nodes
        if isinstance(node, ast.FunctionDef) and node.name.startswith("test_")
        if (found := [*_list_assertions(node, True)]) and not any(found)
    ]


def _list_assertions(node: ast.AST, is_sure: bool) -> Iterator[bool]:
    """For each assertion below a node, tell whether every loop around it surely has items."""
    if _asserts(node):
        yield is_sure and _has_something_to_check(node)
    if isinstance(node, ast.While):
        is_sure = False
    if isinstance(node, ast.For):
        is_sure = is_sure and _has_items(node.iter)
    for child in ast.iter_child_nodes(node):
        if not isinstance(child, ast.FunctionDef | ast.Lambda):
            yield from _list_assertions(child, is_sure)


def _asserts(node: ast.AST) -> bool:
    called = ast.unparse(node.func) if isinstance(node, ast.Call) else ""
    return isinstance(node, ast.Assert) or called.startswith(("np.testing.assert", "pytest.raises"))


def _has_something_to_check(node: ast.AST) -> bool:
    """Tell whether an assertion that something holds for all of a collection surely has items."""
    test, name = node.test if isinstance(node, ast.Assert) else None, "all"
    if isinstance(test, ast.UnaryOp) and isinstance(test.op, ast.Not):
        test, name = test.operand, "any"
    if not (isinstance(test, ast.Call) and ast.unparse(test.func) == name and test.args):
        return True
    items = test.args[0]
    is_loop = isinstance(items, ast.GeneratorExp | ast.ListComp)
    return not is_loop or all(_has_items(part.iter) for part in items.generators)


def _has_items(items: ast.expr) -> bool:
    """Tell whether an expression visibly has items: a display, a range of numbers, `nonempty`."""
    if isinstance(items, ast.Tuple | ast.List | ast.Set):
        return bool(items.elts)
    if isinstance(items, ast.Dict):
        return bool(items.keys)
    if isinstance(items, ast.Constant):
        return bool(items.value)
    if not isinstance(items, ast.Call):
        return False
    name = ast.unparse(items.func).rpartition(".")[2]
    if name == "range":
        return all(isinstance(argument, ast.Constant) for argument in items.args)
    if name in WRAPPERS:
        return all(map(_has_items, items.args))
    return name == "nonempty"
