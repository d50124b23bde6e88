"""The stable models of a small propositional program, by clingo."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any


def stable_models(text: str) -> Iterator[dict[int, int]]:
    """The stable models of a program whose shown atoms are h(term, value), both numbers: term -> value."""
    import clingo  # here, as few programs need it

    control: Any = clingo.Control(["--models=0", "--warn=none"])
    control.add("base", [], text)
    control.ground([("base", [])])
    with control.solve(yield_=True) as found:
        for model in found:
            yield {a.arguments[0].number: a.arguments[1].number for a in model.symbols(shown=True)}
