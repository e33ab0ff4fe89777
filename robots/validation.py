"""How the values of a user's file are checked, and told in one clear line."""

import reprlib
import sys
from typing import Any, TypeGuard


class _Shown(reprlib.Repr):
    def repr_int(self, x: int, level: int) -> str:
        # Python refuses to write an integer of more than 4300 digits.
        if x.bit_length() <= 64:
            return super().repr_int(x, level)
        return f"an integer of {x.bit_length()} bits"


_SHOWN = _Shown()
_SHOWN.maxstring = 60


def shown(value: Any) -> str:
    """Write any value of a file in a few characters on one line."""
    return _SHOWN.repr(value)


def is_number(value: Any) -> TypeGuard[float]:
    """Tell whether a value is a finite number, of a size that a float can hold."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return abs(value) <= sys.float_info.max


def outside(value: float, lower: float, upper: float, unit: str) -> str:
    """Tell a value outside its range, in as many decimals as it takes to see that."""
    is_close = min(abs(value - lower), abs(value - upper)) < 1e-3
    decimals = 9 if is_close else 3
    # Beyond a thousand the decimals say nothing, and a float may have 308 digits.
    number = f"{value:+.{decimals}f}" if abs(value) < 1e3 else f"{value:+.3e}"
    allowed = f"[{lower:+.{decimals}f}, {upper:+.{decimals}f}]"
    return f"{number} {unit}, allowed {allowed} {unit}"
