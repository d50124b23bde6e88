"""A sweep as a TOML file: a domain, axes with their values, and how to score."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import chain, product
from math import prod
from pathlib import Path

from lcorpp.assembly.robot_parts import describe_strategy
from lcorpp.domains import load_domain
from lcorpp.domains.toml import TomlTable, read_toml
from lcorpp.errors import DomainError
from lcorpp.experiments.sweeps.axes import Axis, Configuration, Problem, Setting, hash_domain
from lcorpp.experiments.sweeps.axis_table import find_axis, locate_failures, read_axes
from lcorpp.experiments.sweeps.evaluation import find_rows
from lcorpp.scoring.exact_evaluation import check_enumerable
from lcorpp.simulation import NoisyChannel
from lcorpp.user_code import split_function

MAX_CONFIGURATIONS = 1_000_000
"""Maximum number of configurations of a sweep."""


@dataclass(frozen=True)
class Sweep:
    """A sweep, checked by `read_sweep`.

    file: its file. strategies: their names, with the fingerprints of the user's own.
    axes: axis -> its settings, in the order of the file.
    together: groups of axes that vary jointly; each other axis is a group of its own.
    map_axes: the axes of the figure, one or two.
    """

    file: Path
    problem: Problem
    strategies: tuple[str, ...]
    axes: Mapping[Axis, tuple[Setting, ...]]
    together: tuple[tuple[Axis, ...], ...]
    map_axes: tuple[Axis, ...]

    @property
    def groups(self) -> list[tuple[Axis, ...]]:
        """The groups of axes, one for each factor of the product."""
        leaders, grouped = {group[0]: group for group in self.together}, {*chain(*self.together)}
        return [leaders.get(axis, (axis,)) for axis in self.axes if axis in leaders or axis not in grouped]

    @cached_property
    def configurations(self) -> tuple[Configuration, ...]:
        """All combinations, the last group changing fastest; settings are in the order of the axes."""
        joint = [zip(*(self.axes[axis] for axis in group), strict=True) for group in self.groups]
        order = {axis: number for number, axis in enumerate(self.axes)}
        return tuple(
            tuple(sorted(chain(*parts), key=lambda setting: order[setting.axis])) for parts in product(*joint)
        )

    @property
    def identity(self) -> dict[str, str]:
        """What the scores of all configurations depend on besides their settings, for `UnitStore`."""
        problem = self.problem
        return {
            "lcorpp": problem.version,
            "domain": problem.domain,
            "preset": str(problem.preset),
            "files of the domain": problem.fingerprint,
            "strategies": ", ".join(self.strategies),
            "trials": "none, exact scores" if problem.trials is None else str(problem.trials),
            "seed": str(problem.seed),
        }


def read_sweep(file: Path) -> Sweep:
    r"""Read a sweep and check the values of its axes in the domain.

    Raises:
        FileError, ParseError: the file cannot be read or is not TOML.
        DomainError: a key, name, type or value is wrong; the message names file, line and key.

    Examples:
        >>> from pathlib import Path
        >>> from lcorpp.experiments import read_sweep
        >>> text = 'domain = "intention"\nstrategies = ["LCORPP"]\n[axes]\nnoise = [0.1, 0.3]\n'
        >>> _ = Path("noise.toml").write_text(text)
        >>> sweep = read_sweep(Path("noise.toml"))
        >>> sweep.strategies, [setting.value for (setting,) in sweep.configurations]
        (('LCORPP',), [0.1, 0.3])
    """
    table, folder = read_toml(file), file.resolve().parent
    name = table.text("domain", "intention")
    if (folder / name / "domain.toml").is_file():
        name = str((folder / name).resolve())
    preset = table.text("preset") if "preset" in table else None
    with locate_failures(table.location("domain" if preset is None else "preset")):
        domain = load_domain(name, preset=preset)
    given = table.names("strategies") if "strategies" in table else ()
    names = [_locate_strategy(text, folder) for text in given]
    trials = table.count("trials", 2) if "trials" in table else None
    problem = Problem(
        name, domain.preset, tuple(names), trials, table.count("seed", 0, 0), hash_domain(domain)
    )
    with locate_failures(table.location("strategies")):
        rows = find_rows(problem, domain)
        if trials is None:
            check_enumerable(domain, rows)
        for sense in domain.senses:
            NoisyChannel.from_domain(domain, sense)
    axes = read_axes(table, problem, domain, folder)
    together, figure = _read_together(table, axes), _read_map_axes(table, axes)
    table.reject_unknown_keys()
    described = [describe_strategy(row) for row in rows]
    strategies = tuple(" ".join([row["name"], *filter(None, [row.get("fingerprint")])]) for row in described)
    sweep = Sweep(file, problem, strategies, axes, together, figure)
    size = prod(len(axes[group[0]]) for group in sweep.groups)
    if size > MAX_CONFIGURATIONS:
        raise DomainError(
            f"{table.location('axes')}: {size} configurations; expected at most {MAX_CONFIGURATIONS}"
        )
    return sweep


def _locate_strategy(text: str, folder: Path) -> str:
    """Return the name of a strategy; the file of an own one is relative to the sweep's folder."""
    parts = split_function(text)
    return text if parts is None else f"{(folder / parts[0]).resolve()}:{parts[1]}"


def _read_together(
    table: TomlTable, axes: Mapping[Axis, tuple[Setting, ...]]
) -> tuple[tuple[Axis, ...], ...]:
    """Read the key `together`: lists of names of equally long axes."""
    if "together" not in table:
        return ()
    groups, location = table.value("together"), table.location("together")
    if not isinstance(groups, list) or not all(isinstance(group, list) and group for group in groups):
        raise DomainError(f'{location}: expected lists of axes such as [["noise", "discount"]]')
    found = [tuple([find_axis(location, name, axes) for name in group]) for group in groups]
    names = [*chain(*found)]
    for axis in names:
        if names.count(axis) > 1:
            raise DomainError(f"{location}: {'.'.join(axis)!r} appears twice")
    for group in found:
        sizes = {".".join(axis): len(axes[axis]) for axis in group}
        if len(set(sizes.values())) > 1:
            listed = ", ".join(f"{name} has {size}" for name, size in sizes.items())
            raise DomainError(f"{location}: {listed} values; expected equally many")
    return tuple(found)


def _read_map_axes(table: TomlTable, axes: Mapping[Axis, tuple[Setting, ...]]) -> tuple[Axis, ...]:
    """Read the key `map`: one or two axes; by default the first two with several values."""
    if "map" not in table:
        varied = [axis for axis, settings in axes.items() if len(settings) > 1]
        return tuple((varied or list(axes))[:2])
    names = table.names("map")
    if len(names) > 2:
        raise DomainError(f"{table.location('map')}: {len(names)} axes; expected one or two")
    return tuple([find_axis(table.location("map"), name, axes) for name in names])
