"""Forms: elements for options of a command, made from the fields of its request."""

from __future__ import annotations

import ast
import inspect
import math
from contextlib import suppress
from functools import cache
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Literal, get_args, get_origin

from humanoid_getup.commands.options import CommandRequest
from humanoid_getup.commands.values import find_items, list_notes
from robots.storage.validation import hints_of, split_hint

if TYPE_CHECKING:
    import viser

DEFAULT = "default"
"""Choice in place of an option that is not given."""
STEP = 0.1  # of numbers that begin with 0; those of others follow from their sizes


class Form:
    """Elements whose kinds, limits, first values and texts are those of a request's fields."""

    def __init__(
        self, gui: viser.GuiApi, request: type[CommandRequest], labels: dict[str, str], **shown: Any
    ) -> None:
        """Add elements for fields, by their names, where the caller is adding elements.

        ``shown`` has first values other than those of the request. That of an option which may be
        left out stands for it being left out, by default 0 or an empty text.
        """
        self._request, self._left_out = request, dict[str, Any]()
        self._elements: dict[str, viser.GuiInputHandle[Any]] = {
            name: self._add(gui, name, label, shown.get(name, getattr(request, name, "")))
            for name, label in labels.items()
        }

    def read(self) -> dict[str, Any]:
        """Return the values of the fields."""
        return {name: self._read(name, each.value) for name, each in self._elements.items()}

    def _add(self, gui: viser.GuiApi, name: str, label: str, value: Any) -> Any:
        hint, text = hints_of(self._request)[name], find_text(self._request, name)
        base, meta, is_optional = split_hint(hint)
        if get_origin(base) is Literal:
            choices = (*((DEFAULT,) if is_optional else ()), *get_args(base))
            self._left_out[name] = DEFAULT if is_optional else None
            return gui.add_dropdown(label, choices, initial_value=value or DEFAULT, hint=text)
        if base is bool:
            return gui.add_checkbox(label, value, hint=text)
        if base not in (int, float):
            return gui.add_text(label, value or "", hint=text)
        value = base(value or 0)
        self._left_out[name] = value if is_optional else None
        size = 10.0 ** (math.floor(math.log10(value)) - 1) if value else STEP
        unit = (meta.extra or {}).get("unit")
        return gui.add_number(
            f"{label} [{unit}]" if unit else label,
            value,
            min=meta.ge if value or meta.ge is None else base(0),
            step=1 if base is int else size,
            hint=text,
        )

    def _read(self, name: str, value: Any) -> Any:
        hint = hints_of(self._request)[name]
        base, *_ = split_hint(hint)
        if value == self._left_out.get(name):
            return None
        if base in (int, float):
            return base(value)
        if not (items := find_items(hint)):
            return value
        with suppress(ValueError):  # the request says what is expected
            return tuple(items[0](word) for word in value.split(",") if word.strip())
        return value


@cache
def find_text(request: type, name: str) -> str:
    """Find the text of a request's field, as --help shows it."""
    for note in list_notes(hints_of(request)[name]):
        if text := getattr(note, "help", None):
            return text
    kind = next(each for each in request.__mro__ if name in vars(each).get("__annotations__", {}))
    (definition,) = ast.parse(inspect.getsource(kind)).body
    assert isinstance(definition, ast.ClassDef)
    for field, after in pairwise(definition.body):
        is_field = isinstance(field, ast.AnnAssign) and ast.unparse(field.target) == name
        if is_field and isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant):
            return inspect.cleandoc(str(after.value.value))
    return ""
