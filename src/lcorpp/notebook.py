"""Short texts and HTML tables for the `repr` and `_repr_html_` of values."""

from __future__ import annotations

from collections.abc import Iterable, Sequence


def join_some(parts: Sequence[str], limit: int = 6) -> str:
    """Join at most `limit` parts with commas; more are cut and counted: ``a, b, ... (9 in all)``."""
    cut = f", ... ({len(parts)} in all)" if len(parts) > limit else ""
    return ", ".join(parts[:limit]) + cut


STYLE = (
    "<style>.lcorpp{overflow-x:auto}.lcorpp table{border-collapse:collapse;min-width:min(100%,26em);"
    "font-variant-numeric:tabular-nums}.lcorpp :is(th,td,caption){text-align:left;vertical-align:top;"
    "padding:.2em .9em .2em 0}.lcorpp td{border-top:thin solid color-mix(in srgb,currentcolor 25%,#0000)}"
    "</style>"
)
"""Of all tables; colours are those of the page, light or dark."""


def html_table(
    header: Sequence[str], rows: Iterable[Sequence[str]], *, caption: str = "", limit: int = 100
) -> str:
    """Return an HTML table; all texts are escaped, and at most `limit` rows are shown."""
    from html import escape  # here, as commands need none of its tables

    def format_row(tag: str, cells: Sequence[str]) -> str:
        return f"<tr>{''.join(f'<{tag}>{escape(cell)}</{tag[:2]}>' for cell in cells)}</tr>"

    all_rows = list(rows)
    lines = [format_row("td", row) for row in all_rows[:limit]]
    if len(all_rows) > limit:
        lines.append(format_row("td", [f"... ({len(all_rows)} rows in all)"]))
    title = f"<caption>{escape(caption)}</caption>" if caption else ""
    head = format_row('th scope="col"', header)
    table = f"<table>{title}<thead>{head}</thead><tbody>{''.join(lines)}</tbody></table>"
    return f'<div class="lcorpp">{STYLE}{table}</div>'
