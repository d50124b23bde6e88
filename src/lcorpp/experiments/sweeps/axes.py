"""The axes of a sweep: what may vary in a domain, and the domain at one value of each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from math import inf
from pathlib import Path
from typing import Any

import lcorpp
from lcorpp.assembly.robot_parts import find_fingerprint, hash_bytes
from lcorpp.domains import Domain, load_domain
from lcorpp.domains.sections.learning import Sense
from lcorpp.errors import DomainError, WorkerError
from lcorpp.experiments.sweeps import changes
from lcorpp.experiments.tables import hash_code

Axis = tuple[str, ...]
"""The parts of the dotted name of an axis."""

Value = float | int | str

ANY, POSITIVE, PROBABILITY = (-inf, inf), (0.0, inf), (0.0, 1.0)
"""The range of the numbers of an axis."""

SECTIONS = ("reasoning", "planning", "simulation")
"""Sections of `domain.toml` whose keys are axes."""


def find_version() -> str:
    """Return the version of lcorpp with the fingerprint of its code."""
    return f"{lcorpp.__version__} ({hash_code()})"


@dataclass(frozen=True)
class Setting:
    """An axis at one value.

    file: the file that a text names, "" for other values. digest: of the file's content.
    """

    axis: Axis
    value: Value
    file: str = ""
    digest: str = ""

    @property
    def name(self) -> str:
        """The dotted name of the axis."""
        return ".".join(self.axis)

    @property
    def is_loaded(self) -> bool:
        """Whether the folder of the domain is read again."""
        return self.axis[0] in (*SECTIONS, "noise", "knowledge")


Configuration = tuple[Setting, ...]
"""One setting of each axis."""


@dataclass(frozen=True)
class Problem:
    """What all configurations of a sweep have in common.

    domain: a folder, or the name of a shipped domain. preset: None for the first.
    strategies: names, () for all of the domain. trials: simulated people, None for exact scores.
    seed: of the sweep. fingerprint: of the domain's files. version: of lcorpp and its code.
    """

    domain: str
    preset: str | None
    strategies: tuple[str, ...]
    trials: int | None
    seed: int
    fingerprint: str
    version: str = field(default_factory=find_version)


def list_axes(domain: Domain) -> dict[Axis, tuple[float, float]]:
    """Return the axes of a domain besides the keys of `domain.toml`, and the range of their numbers."""
    planning, shared = domain.planning, domain.reasoning.shared
    found: dict[Axis, tuple[float, float]] = {("discount",): PROBABILITY}
    if (domain.simulation.feedback_model != domain.pomdp.observation.dense).any():
        found["noise",] = PROBABILITY
    for action in domain.pomdp.actions:
        if action not in planning.reports:
            found["cost", action] = POSITIVE
    for which in ("right", "wrong"):
        found["reward", which] = ANY
        if len(shared) == 1:
            found |= {("reward", which, str(value)): ANY for value in domain.values}
    found |= {("limit", limit.name): POSITIVE for limit in planning.limits}
    both: list[Axis] = []
    for sense in domain.all_senses:
        name = (sense.name,) if len(domain.all_senses) > 1 else ()
        simulation = domain.simulation
        if sense.name in simulation.noisy_channels and sense.name not in simulation.joint_labels:
            both += [("classifier", *name, value) for value in sense.classes]
    for attribute in shared:
        name = (attribute,) if len(shared) > 1 else ()
        both += [("prevalence", *name, value) for value in domain.program.attributes[attribute].values]
    atoms = {atom for p in (domain.program, domain.simulation.true_program) for atom in changes.list_atoms(p)}
    both += [("pr", atom) for atom in sorted(atoms)]
    for path in both:
        found |= {prefix + path: PROBABILITY for prefix in ((), ("known",), ("true",))}
    return found


def change_domain(domain: Domain, setting: Setting) -> Domain:
    """Return a domain with a setting of `list_axes`."""
    axis, number = setting.axis, float(setting.value)
    known, true = axis[0] != "true", axis[0] != "known"
    sides = {"known": known, "true": true}
    match axis if known and true else axis[1:]:
        case ("discount",):
            return changes.with_discount(domain, number)
        case ("cost", action):
            return changes.with_cost(domain, action, number)
        case ("limit", name):
            return changes.with_limit(domain, name, number)
        case ("reward", which, *value):
            return changes.with_report_reward(
                domain, value[0] if value else None, number, right=which == "right"
            )
        case ("classifier", *sense, value):
            return changes.with_rate(domain, _find_sense(domain, sense), value, number, **sides)
        case ("prevalence", *attribute, value):
            name = attribute[0] if attribute else domain.reasoning.shared[0]
            return changes.with_prevalence(domain, name, value, number, **sides)
        case ("pr", atom):
            return changes.with_number(domain, atom, number, **sides)
    raise DomainError(f"unknown axis {setting.name}")


def _find_sense(domain: Domain, names: list[str]) -> Sense:
    return domain.find_sense(names[0]) if names else domain.all_senses[0]


@lru_cache(maxsize=64)
def configure(problem: Problem, configuration: Configuration) -> Domain:
    """Return the domain of a configuration. Configurations with the same first settings share their parts.

    Raises:
        WorkerError: this process has another version of lcorpp or of the domain's files.
        DomainError, ProgramError, ModelError: a value is impossible.
    """
    settings = sorted(configuration, key=lambda setting: not setting.is_loaded)
    if settings and not settings[-1].is_loaded:
        return change_domain(configure(problem, tuple(settings[:-1])), settings[-1])
    _check_worker(problem)
    return _load(problem, settings)


@lru_cache(maxsize=4)
def _check_worker(problem: Problem) -> None:
    """Check that this process, perhaps on another machine, has the same lcorpp and the same domain."""
    if problem.version != find_version():
        raise WorkerError(f"a worker has lcorpp {find_version()}; expected {problem.version}")
    if hash_domain(_load(problem, [])) != problem.fingerprint:
        raise WorkerError(f"the files of the domain {problem.domain} differ for a worker")


def hash_domain(domain: Domain) -> str:
    """Return the fingerprint of what determines the scores in a domain."""
    simulation, planning, own = domain.simulation, domain.planning, domain.reasoning.own_reasoners
    parts = (
        str(domain.program),
        str(simulation.true_program),
        sorted(simulation.noisy_channels.items()),
        sorted(simulation.presence.items()),
        domain.pomdp.fingerprint,
        domain.pomdp.start.tolist(),
        sorted(planning.reports.items()),
        planning.initial_states.tolist(),
        planning.state_values.tolist(),
        planning.terminal,
        planning.solver,
        domain.observed,
        domain.all_senses,
        *([] if own is None else [find_fingerprint(own.source)]),
        *[(limit.name, limit.bound, limit.kind, limit.cost.tolist()) for limit in planning.limits],
        *[own_model.tolist() for own_model in simulation.limit_models],
        simulation.feedback_model.tolist(),
        *([] if simulation.transition is None else [simulation.transition.dense.tolist()]),
    )
    return hash_bytes(repr(parts).encode())


def _load(problem: Problem, settings: list[Setting]) -> Domain:
    """Return the domain with keys of `domain.toml` and the robot's program changed."""
    paths = {("simulation", "noise") if s.axis == ("noise",) else s.axis: s.value for s in settings}
    paths.pop(("knowledge",), None)
    domain = load_domain(problem.domain, preset=problem.preset, changes=_nest(paths))
    for setting in settings:
        if setting.axis == ("knowledge",):  # people stay as they are
            known = load_domain(
                problem.domain,
                preset=problem.preset,
                changes=_nest({**paths, ("reasoning", "program"): Path(setting.file)}),
            )
            domain = replace(known, simulation=domain.simulation)
    return domain


def _nest(paths: Mapping[Axis, Value | Path]) -> dict[str, Any]:
    """Return dotted paths as nested tables."""
    tables: dict[str, Any] = {}
    for path, value in paths.items():
        table = tables
        for name in path[:-1]:
            table = table.setdefault(name, {})
        table[path[-1]] = value
    return tables
