"""Files of finished figures: tables, pictures, and a description that a later run and the report read."""

from __future__ import annotations

import platform
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import lcorpp
from lcorpp.errors import DataError
from lcorpp.experiments.figures.result import FigureOptions, FigureResult, Layout
from lcorpp.experiments.tables import has_parquet, hash_code, write_csv, write_json, write_parquet
from lcorpp.files import make_folder, read_text
from lcorpp.plot_style import save_figure
from lcorpp.versioned_json import JsonFormat

FORMAT = JsonFormat("lcorpp figure", 1)
"""Of the format of the description."""

LAYOUTS: Mapping[Layout, Sequence[str]] = {"wide": ("svg", "pdf", "png"), "column": ("svg",)}
"""Layout -> formats of the pictures; those in a column are for phones and have "-column" in their name."""


@dataclass(frozen=True, eq=False)
class StoredFigure:
    """A finished figure as it is stored.

    content: the description, see `_describe`. pictures: layout -> SVG.
    """

    content: Mapping[str, Any]
    pictures: Mapping[Layout, str]

    @property
    def name(self) -> str:
        return str(self.content["name"])

    @property
    def seconds(self) -> float:
        """The time that its computation took."""
        return float(self.content["seconds"])


def store_figure(folder: Path, result: FigureResult, options: FigureOptions, seconds: float) -> None:
    """Write the files of a figure, the description last: without it the figure counts as unfinished.

    Raises:
        FileError: a file cannot be written.
    """
    make_folder(folder)
    table = folder / f"{result.name}.csv"
    write_csv(table, list(result.table[0]), result.table)
    if has_parquet():
        write_parquet(table.with_suffix(".parquet"), result.table)
    for layout, formats in LAYOUTS.items():
        figure = result.draw(layout)
        for suffix in formats:
            save_figure(figure, folder / _name_picture(result.name, layout, suffix))
    write_json(_find_description(folder, result.name), _describe(result, options, seconds))


def load_figure(folder: Path, name: str, options: FigureOptions) -> StoredFigure | None:
    """Return a finished figure; None if the folder has none of this name.

    Raises:
        DataError: the description is damaged or has another format, or the figure was made with other options
            or by another state of lcorpp.
        FileError: a file is missing or cannot be read.
    """
    path = _find_description(folder, name)
    if not path.exists():
        return None
    try:
        content = FORMAT.read(read_text(path))
    except DataError as error:
        raise DataError(f"{path}: not the description of a figure: {error}; expected another --out") from None
    if difference := _find_difference(content, options):
        raise DataError(
            f"{folder}: the figure {name} cannot be reused: {difference}; expected another folder (--out), or"
            " --again, which replaces it"
        )
    pictures = {layout: read_text(folder / _name_picture(name, layout, "svg")) for layout in LAYOUTS}
    return StoredFigure(content, pictures)


def _find_difference(then: Mapping[str, Any], options: FigureOptions) -> str | None:
    """Return in what a description's options or code differ from the present ones; None if in nothing."""
    now = _identify(options)
    if then["code"] != now["code"]:
        release = "another state of" if then["lcorpp"] == now["lcorpp"] else f"{then['lcorpp']} instead of"
        return f"it was made by {release} lcorpp {now['lcorpp']}"
    for key, value in now["options"].items():
        if then["options"].get(key) != value:
            return f"it was made with {key} = {then['options'].get(key)}, not {value}"
    return None


def _describe(result: FigureResult, options: FigureOptions, seconds: float) -> dict[str, Any]:
    """Return all of a figure but its pictures and the versions, as JSON."""
    return {
        **FORMAT.header,
        **_identify(options),
        "name": result.name,
        "title": result.title,
        "paragraph": result.paragraph,
        "findings": [vars(finding) for finding in result.findings],
        "notes": list(result.notes),
        "deviations": [
            {
                "setting": row.setting,
                "what": row.what,
                "ours": [row.ours.estimate, row.ours.low, row.ours.high],
                "published": row.published,
                "difference": row.difference,
                "in_standard_errors": row.in_standard_errors,
                "reason": row.reason,
            }
            for row in result.deviations
        ],
        "table": [dict(row) for row in result.table],
        "configuration": dict(result.configuration),
        "seconds": seconds,
        "machine": f"{platform.system()} {platform.machine()}",
    }


def _identify(options: FigureOptions) -> dict[str, Any]:
    """Return what a figure's numbers depend on."""
    return {"lcorpp": lcorpp.__version__, "code": hash_code(), "options": options.identity}


def _find_description(folder: Path, name: str) -> Path:
    return folder / f"{name}.json"


def _name_picture(name: str, layout: Layout, suffix: str) -> str:
    return f"{name}.{suffix}" if layout == "wide" else f"{name}-{layout}.{suffix}"
