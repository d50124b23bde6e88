"""Mends of what Sphinx and furo write and assistive technology cannot read."""

from __future__ import annotations

import re
from typing import Any

_PARAMETERS = re.compile(r"<dl>\s*((?:<dd>(?:(?!</?d[dl]>).)*</dd>\s*)+)</dl>", re.DOTALL)


def mend_body(body: str) -> str:
    """Return a page's body in which long lists of parameters are lines, not descriptions without a term."""

    def write_lines(found: re.Match[str]) -> str:
        lines = found[1].replace("<dd>", '<span class="parameter">').replace("</dd>", "</span>")
        return f'<span class="parameters">{lines}</span>'

    return _PARAMETERS.sub(write_lines, body)


def mend_navigation(navigation: str) -> str:
    """Return the sidebar with levels of its headings."""
    return navigation.replace('role="heading">', 'role="heading" aria-level="2">')


def _mend_page(_app: Any, _page: str, _template: str, context: dict[str, Any], _doctree: Any) -> None:
    context["body"] = mend_body(context.get("body", ""))
    context["furo_navigation_tree"] = mend_navigation(context.get("furo_navigation_tree", ""))


def setup(app: Any) -> dict[str, Any]:
    """Connect to Sphinx; furo forms the sidebar with priority 500."""
    app.connect("html-page-context", _mend_page, priority=900)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
