"""The folder of a learnt model: the model and a report, and with reports a domain that runs."""

from __future__ import annotations

import json
from itertools import pairwise
from pathlib import Path

import numpy as np

from lcorpp.domains.new_domain import check_name
from lcorpp.domains.new_folder import write_folder
from lcorpp.model_learning.episodes import Episodes
from lcorpp.model_learning.learnt_model import OVER, LearntModel
from lcorpp.model_learning.report import format_report
from lcorpp.model_learning.spaces import Space
from lcorpp.planning import Pomdp, SparseTables, format_pomdp
from lcorpp.values import Array

DIGITS = 6
"""Decimals of the numbers of the knowledge."""


def write_model(folder: Path, learnt: LearntModel, *, reports: str | None = None) -> None:
    """Write a learnt model completely or not at all.

    interaction.pomdp and report.md; with the pattern of the reports also domain.toml and knowledge.plog, with
    the rates of the shared values. A domain has as many states of each shared value: those that are missing
    are copies that nothing reaches.

    Raises:
        DomainError: the folder is not empty.
        FileError: it cannot be written.

    Examples:
        >>> from lcorpp.model_learning import Episodes, Step, learn_model, write_model
        >>> heads, tails = Step("look", "h", -1), Step("look", "t", -1)
        >>> people = [[heads, Step("say_heads", "none", 5)], [tails, Step("say_heads", "none", -5)],
        ...           [tails, Step("say_tails", "none", 5)], [heads, Step("say_tails", "none", -5)]] * 20
        >>> learnt = learn_model(Episodes.of(people, [True] * 80), reports="say_{side}")
        >>> from pathlib import Path
        >>> write_model(Path("coins"), learnt, reports="say_{side}")
        >>> sorted(path.name for path in Path("coins").iterdir())
        ['domain.toml', 'interaction.pomdp', 'knowledge.plog', 'report.md']
    """
    texts = {"report.md": format_report(learnt)}
    if reports is None:
        texts["interaction.pomdp"] = format_pomdp(learnt.pomdp)
    else:
        numbers = _number_states(learnt)
        texts["interaction.pomdp"] = _format_filled(learnt, numbers)
        texts["domain.toml"] = _format_toml(folder.absolute().name, learnt, reports, max(numbers))
        texts["knowledge.plog"] = _format_knowledge(learnt)
    write_folder(folder, texts)


def check_names(episodes: Episodes, reports: str | None) -> None:
    """Check that the names of episodes can be written, before a model is learnt.

    Raises:
        ModelError: the name of an action or observation has a space or another character with a meaning.
        DataError: the pattern of the reports does not fit to the actions.
        DomainError: a variable or value of the reports is no name in P-log.
    """
    A, names = len(episodes.action_names), (episodes.action_names, episodes.observation_names)
    observation = np.zeros((A, 1, len(episodes.observation_names)))
    observation[:, :, 0] = 1.0
    tables = SparseTables.of(np.ones((A, 1, 1))), SparseTables.of(observation)
    format_pomdp(Pomdp((OVER,), *names, *tables, np.zeros((A, 1)), 0.0, np.ones(1)))
    if reports is not None:
        space = Space.of_reports(episodes, reports)
        for i, variable in enumerate(space.variables):
            check_name("variable", variable)
            for value in dict.fromkeys(own[i] for own in space.values):
                check_name(f"value of {variable}", value)


def _number_states(learnt: LearntModel) -> list[int]:
    """Return the number of each state among those of its shared value, from 1."""
    values = learnt.model.structure.values
    return [int((values[:k] == values[k]).sum()) + 1 for k in range(len(values))]


def _format_filled(learnt: LearntModel, numbers: list[int]) -> str:
    """Return the model, with as many states of each value, in the order of the values."""
    values, most = learnt.model.structure.values.tolist(), max(numbers)
    place = {(v, n): k for k, (v, n) in enumerate(zip(values, numbers, strict=True))}
    wanted = [(v, n) for v in range(len(learnt.space)) for n in range(1, most + 1)]
    sources = [place.get(own, place[own[0], 1]) for own in wanted]
    columns = [place.get(own, -1) for own in wanted]  # nothing leads to a copy
    own, K = learnt.model.parameters, len(learnt.states)
    is_copy = np.array(columns) < 0
    moved = np.where(is_copy, 0.0, own.transition[:, sources][:, :, columns])
    transition = np.zeros((len(moved), len(wanted) + 1, len(wanted) + 1))
    transition[:, :-1, :-1], transition[:, :-1, -1] = moved, own.transition[:, sources, K]
    transition[:, -1, -1] = 1.0
    names = ["_".join((*learnt.space.values[v], *([str(n)] if most > 1 else []))) for v, n in wanted]
    pomdp, rows = learnt.pomdp, np.append(sources, K)
    filled = Pomdp(
        (*names, OVER),
        pomdp.actions,
        pomdp.observations,
        SparseTables.of(transition),
        SparseTables.of(own.observation[:, rows]),
        pomdp.reward[:, rows],
        pomdp.discount,
        np.append(np.where(is_copy, 0.0, own.start[sources]), 0.0),
    )
    return format_pomdp(filled)


def _format_toml(name: str, learnt: LearntModel, reports: str, most: int) -> str:
    variables = learnt.space.variables
    states = "_".join(f"{{{variable}}}" for variable in (*variables, *(["phase"] if most > 1 else [])))
    lines = [
        "# Learnt by `lcorpp model`; report.md has the interval of each number.",
        f"name = {json.dumps(name)}",
        f"description = {json.dumps(f'Learnt from {len(learnt.episodes)} episodes.')}",
        "",
        "[reasoning]",
        'program = "knowledge.plog"',
        "observed = []                     # no facts: the knowledge has rates only",
        f"shared = {json.dumps(list(variables))}",
        "",
        "[planning]",
        'model = "interaction.pomdp"',
        f"states = {json.dumps(states)}",
        f"terminal = {json.dumps(OVER)}",
        f"reports = {json.dumps(reports)}",
    ]
    if most > 1:
        phases = json.dumps([str(n) for n in range(1, most + 1)])
        lines += ["", "[planning.local.phase]            # what follows from actions", f"values = {phases}"]
    return "\n".join(lines) + "\n"


def _format_knowledge(learnt: LearntModel) -> str:
    """Return a program in which each shared variable depends on those before it."""
    variables, values = learnt.space.variables, learnt.space.values
    names = [list(dict.fromkeys(value[i] for value in values)) for i in range(len(variables))]
    start = learnt.model.parameters.start[: len(values)].reshape([len(own) for own in names])
    lines = [f"% Rates of the shared values in {len(learnt.episodes)} episodes."]
    for variable, own in zip(variables, names, strict=True):
        lines.append(f"{variable}_values = {{{', '.join(own)}}}.")
        lines.append(f"{variable} : {variable}_values.   random({variable}).")
    for i, variable in enumerate(variables):
        joint = start.sum(axis=tuple(range(i + 1, len(variables))))
        for before in np.ndindex(joint.shape[:-1]):
            body = ", ".join(
                f"{v}={names[j][b]}" for j, (v, b) in enumerate(zip(variables, before, strict=False))
            )
            for value, probability in zip(names[i], _round(joint[before]), strict=True):
                lines.append(f"pr({variable}={value}{f' | {body}' if body else ''}) = {probability}.")
    return "\n".join(lines) + "\n"


def _round(weights: Array) -> list[str]:
    """Return probabilities with a fixed number of decimals that sum to 1."""
    sums = np.round(np.append(0.0, np.cumsum(weights / weights.sum())), DIGITS)
    return [f"{after - before:.{DIGITS}f}" for before, after in pairwise(sums.tolist())]
