"""The report: one HTML file with all finished figures, without scripts, images or fonts from elsewhere."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from html import escape
from importlib.resources import files
from pathlib import Path
from string import Template
from typing import Any

from lcorpp.experiments.figures.published import MAX_STANDARD_ERRORS
from lcorpp.experiments.figures.result import Verdict
from lcorpp.experiments.figures.storage import StoredFigure
from lcorpp.files import write_atomically

DIGITS = {"cost": 2, "return": 2, "cost_sd": 2}
"""Decimal places of the columns of tables; others have three."""


def write_report(path: Path, figures: Sequence[StoredFigure]) -> None:
    """Write the report.

    Raises:
        FileError: the file cannot be written.
    """
    write_atomically(path, make_report(figures))


def make_report(figures: Sequence[StoredFigure]) -> str:
    """Return the report of finished figures, at least one, in their order."""
    folder = files("lcorpp.experiments.figures")
    template = Template(folder.joinpath("report.html").read_text(encoding="utf-8"))
    content = figures[0].content  # options, code and machine are those of every figure
    return template.substitute(
        style=folder.joinpath("report.css").read_text(encoding="utf-8"),
        links="".join(f'<li><a href="#{f.name}">{escape(f.content["title"])}</a></li>' for f in figures),
        figures="".join(map(_format_figure, figures)),
        options=escape(_join(content["options"])),
        code=escape(content["code"]),
        versions=escape(_join(content["versions"])),
        machine=escape(content["machine"]),
        seconds=_format_seconds(sum(figure.seconds for figure in figures)),
    )


def _format_figure(figure: StoredFigure) -> str:
    content = figure.content
    pictures = "".join(
        f'<div class="picture {layout}">{_inline(svg, f"{figure.name}-{layout}", content["title"])}</div>\n'
        for layout, svg in figure.pictures.items()
    )
    findings = "".join(map(_format_finding, content["findings"]))
    notes = "".join(f"<p>{escape(note)}</p>\n" for note in content["notes"])
    return (
        f'<section id="{figure.name}">\n<h2>{escape(content["title"])}</h2>\n{pictures}'
        f'<ul class="findings">{findings}</ul>\n{notes}{_format_deviations(content["deviations"])}'
        f"<h3>All numbers</h3>\n{_format_rows(content['table'])}"
        f'<p class="muted">{escape(_join(content["configuration"]))}; {_format_seconds(figure.seconds)}.'
        f" Files: {', '.join(escape(figure.name) + end for end in ('.csv', '.svg', '.pdf', '.png'))}.</p>\n"
        "</section>\n"
    )


def _format_finding(finding: Mapping[str, str]) -> str:
    """Return a list item; its class is the name of the verdict."""
    kind = Verdict(finding["verdict"]).name.lower()
    claim, evidence = escape(finding["claim"]), escape(finding["evidence"])
    return f'<li class="{kind}">{claim}: <b>{escape(finding["verdict"])}</b> ({evidence}).</li>'


def _format_deviations(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return the table of ours beside the published numbers, and below it the reasons that it refers to."""
    if not rows:
        return ""
    reasons: dict[str, int] = {}
    lines = []
    for row in rows:
        digits = max(3, len(row["published"].partition(".")[2]) + 1)
        errors = row["in_standard_errors"]
        far = errors is not None and abs(errors) > MAX_STANDARD_ERRORS
        reason = row["reason"] or ("not known" if far else "")
        cells = [
            row["setting"],
            row["what"],
            f"{row['ours'][0]:.{digits}f}",
            row["published"],
            f"{row['difference']:+.{digits}f}",
            "" if errors is None else f"{errors:+.1f}",
            f"({reasons.setdefault(reason, len(reasons) + 1)})" if reason else "",
        ]
        kind = ' class="far"' if far else ""
        lines.append(f"<tr{kind}>" + "".join(f"<td>{escape(cell)}</td>" for cell in cells) + "</tr>\n")
    header = ("setting", "what", "ours", "published", "difference", "in s.e.", "why")
    caption = f"s.e.: standard errors. More than {MAX_STANDARD_ERRORS} of them are in bold type."
    whys = "".join(f"<li>{escape(reason)}</li>" for reason in reasons)
    table = _format_table(header, lines, caption)
    return f"<h3>Ours beside the published numbers</h3>\n{table}" + (f"<ol>{whys}</ol>\n" if whys else "")


def _format_rows(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return a tidy table; a column and the ends of its interval share a cell, equal ends are left out."""
    names = [name for name in rows[0] if not re.fullmatch(r"(.*)_(low|high)", name)]
    lines = []
    for row in rows:
        cells = [_format_cell(name, row) for name in names]
        lines.append("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in cells) + "</tr>\n")
    return _format_table([name.replace("_", " ") for name in names], lines)


def _format_cell(name: str, row: Mapping[str, Any]) -> str:
    value = row[name]
    if not isinstance(value, float):
        return "" if value is None else str(value)
    digits = DIGITS.get(name, 3)
    low, high = row.get(f"{name}_low", value), row.get(f"{name}_high", value)
    interval = "" if low == high else f" [{low:.{digits}f}, {high:.{digits}f}]"
    return f"{value:.{digits}f}{interval}"


def _format_table(header: Sequence[str], lines: Sequence[str], caption: str = "") -> str:
    """Return a table that scrolls sideways on narrow screens."""
    title = f"<caption>{escape(caption)}</caption>" if caption else ""
    head = "".join(f'<th scope="col">{escape(name)}</th>' for name in header)
    return (
        f'<div class="scroll" tabindex="0" role="region" aria-label="table"><table>{title}\n'
        f"<thead><tr>{head}</tr></thead>\n<tbody>\n{''.join(lines)}</tbody>\n</table></div>\n"
    )


def _inline(svg: str, prefix: str, title: str) -> str:
    """Return an SVG for use within HTML: ids that are unique in the page, a text for screen readers."""
    body = svg[svg.index("<svg") :]
    for reference in ('id="', 'href="#', "url(#"):
        body = body.replace(reference, f"{reference}{prefix}-")
    body = re.sub(r"<metadata>.*?</metadata>", "", body, flags=re.DOTALL)
    return body.replace("<svg", f'<svg role="img" aria-label="{escape(title)}"', 1)


def _join(values: Mapping[str, Any]) -> str:
    return ", ".join(f"{name} {value}" for name, value in values.items())


def _format_seconds(seconds: float) -> str:
    return f"{seconds:.1f} s" if seconds < 90 else f"{seconds / 60:.1f} min"
