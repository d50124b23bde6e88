"""Formulas as MathML, which browsers draw themselves: no script, no font, no server."""

from __future__ import annotations

from typing import Any

from docutils.nodes import SkipNode
from docutils.utils.math.latex2mathml import tex2mathml


def _visit_formula(translator: Any, node: Any) -> None:
    translator.body.append(tex2mathml(node.astext()))
    raise SkipNode


def _visit_display(translator: Any, node: Any) -> None:
    translator.body.append(tex2mathml(node.astext(), as_block=True))
    raise SkipNode


def setup(app: Any) -> dict[str, Any]:
    """Connect to Sphinx."""
    app.add_html_math_renderer("mathml", (_visit_formula, None), (_visit_display, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
