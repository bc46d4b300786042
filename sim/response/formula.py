# SPDX-License-Identifier: GPL-3.0-or-later
"""Formulas that numpy and a Blender driver both know: sums, products, quotients, least and most.

What `Formula.text` writes is within Blender's *simple expressions* (manual, Animation, Drivers): they are evaluated
without Python, so that they play in a file that may run no scripts.
"""

from dataclasses import dataclass

import numpy as np

#: Characters a driver's expression may have.
LONGEST = 255


@dataclass(frozen=True)
class Formula:
    """op: ``value`` (a number), ``of`` (the quantity called ``name``), ``+``, ``*``, ``/``, ``min`` or ``max``."""

    op: str
    parts: tuple["Formula", ...] = ()
    number: float = 0.0
    name: str = ""

    def __add__(self, other):
        return Formula("+", (self, as_formula(other)))

    __radd__ = __add__

    def __sub__(self, other):
        return self + as_formula(other) * -1.0

    def __rsub__(self, other):
        return as_formula(other) - self

    def __mul__(self, other):
        return Formula("*", (self, as_formula(other)))

    __rmul__ = __mul__

    def __truediv__(self, other):
        return Formula("/", (self, as_formula(other)))

    def names(self) -> list[str]:
        """The quantities used, in the order of their first use."""
        own = [self.name] if self.op == "of" else []
        return list(dict.fromkeys(own + [name for part in self.parts for name in part.names()]))

    def value(self, quantities: dict[str, np.ndarray]) -> np.ndarray:
        """Its value, given those of the quantities."""
        if self.op == "value":
            return np.asarray(self.number)
        if self.op == "of":
            return quantities[self.name]
        a, b = (part.value(quantities) for part in self.parts)
        with np.errstate(divide="ignore", invalid="ignore"):
            return {"+": np.add, "*": np.multiply, "/": np.divide, "min": np.minimum, "max": np.maximum}[self.op](a, b)

    def text(self, letters: dict[str, str]) -> str:
        """The driver's expression, with quantities called by their ``letters``."""
        if self.op == "value":
            return _number(self.number)
        if self.op == "of":
            return letters[self.name]
        a, b = (part.text(letters) for part in self.parts)
        if self.op in ("min", "max"):
            return f"{self.op}({a},{b})"
        if self.op == "+":
            return f"{a}{b}" if b.startswith("-") else f"{a}+{b}"
        if self.op == "*" and b in ("-1", "1"):
            return a if b == "1" else f"-{_bound(self.parts[0], a)}"
        return f"{_bound(self.parts[0], a)}{self.op}{_bound(self.parts[1], b, self.op == '/')}"


def _bound(part: Formula, text: str, below: bool = False) -> str:
    """In brackets where an operator would take it apart."""
    loose = part.op == "+" or text.startswith("-") or (below and part.op in ("*", "/"))
    return f"({text})" if loose else text


def _number(value: float) -> str:
    text = f"{value:.4g}"
    return text if "e" not in text else f"{value:.6f}".rstrip("0").rstrip(".")


def as_formula(value) -> Formula:
    """A number as a formula; a formula as it is."""
    return value if isinstance(value, Formula) else Formula("value", number=float(_number(float(value))))


def of(name: str) -> Formula:
    """The quantity called ``name``."""
    return Formula("of", name=name)


def least(a, b) -> Formula:
    """min(a, b)."""
    return Formula("min", (as_formula(a), as_formula(b)))


def most(a, b) -> Formula:
    """max(a, b)."""
    return Formula("max", (as_formula(a), as_formula(b)))


def clipped(value: Formula, low: float, high: float) -> Formula:
    """``value`` kept within low..high."""
    return least(most(value, low), high)


def weighted(weights: dict[str, float]) -> Formula:
    """The sum of quantities times their weights."""
    terms = [of(name) * weight if weight != 1 else of(name) for name, weight in weights.items()]
    total = terms[0] if terms else as_formula(0.0)
    for term in terms[1:]:
        total = total + term
    return total


def tent(value: Formula, left: float, top: float, right: float) -> Formula:
    """1 at ``top``, straight down to 0 at ``left`` and ``right``, 0 beyond."""
    return most(least((value - left) * (1 / (top - left)), (right - value) * (1 / (right - top))), 0.0)
