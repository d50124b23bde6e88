"""Figure files: one figure in several formats."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from matplotlib.figure import Figure

from lcorpp.plot_style import save_figure


def write_figure(figure: Figure, folder: Path, name: str, formats: Sequence[str]) -> list[Path]:
    """Write a figure in each format ("png", "svg", "pdf") and return the paths."""
    paths = [folder / f"{name}.{suffix}" for suffix in formats]
    for path in paths:
        save_figure(figure, path)
    return paths
