"""The folder of a learnt model: the model and a report, and with reports a domain that runs."""

from __future__ import annotations

import json
from itertools import pairwise
from pathlib import Path

import numpy as np

from lcorpp.domains.new_domain import check_name
from lcorpp.domains.new_folder import write_folder
from lcorpp.model_learning.baum_welch import Parameters
from lcorpp.model_learning.episodes import Episodes
from lcorpp.model_learning.learnt_model import OVER, LearntModel, make_pomdp
from lcorpp.model_learning.report import format_report
from lcorpp.model_learning.spaces import Space
from lcorpp.planning import Pomdp, SparseTables, format_pomdp
from lcorpp.values import Array

DIGITS = 6
"""Decimals of the numbers of the knowledge."""


def write_model(folder: Path, learnt: LearntModel) -> None:
    """Write a learnt model completely or not at all.

    interaction.pomdp and report.md; of a model with reports also domain.toml and knowledge.plog, with the
    rates of the shared values. A domain has as many states of each shared value: those that are missing
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
        >>> write_model(Path("coins"), learnt)
        >>> sorted(path.name for path in Path("coins").iterdir())
        ['domain.toml', 'interaction.pomdp', 'knowledge.plog', 'report.md']
    """
    texts = {"report.md": format_report(learnt)}
    if learnt.space.variables:
        texts["interaction.pomdp"] = _format_filled(learnt)
        texts["domain.toml"] = _format_toml(folder.absolute().name, learnt)
        texts["knowledge.plog"] = _format_knowledge(learnt)
    else:
        texts["interaction.pomdp"] = format_pomdp(learnt.pomdp)
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


def _format_filled(learnt: LearntModel) -> str:
    """Return the model with equally many states of each value, in the order of the values."""
    structure, own = learnt.model.structure, learnt.model.parameters
    numbers, count = structure.numbers, own.count
    place = {(v, n): k for k, (v, n) in enumerate(zip(structure.values.tolist(), numbers, strict=True))}
    wanted = [(v, n) for v in range(len(learnt.space)) for n in range(1, max(numbers) + 1)]
    sources = [place.get(state, place[state[0], 1]) for state in wanted]
    is_copy, rows = np.array([state not in place for state in wanted]), [*sources, count]
    transition = own.transition[:, sources][:, :, rows]
    transition[:, :, :-1][:, :, is_copy] = 0.0  # nothing leads to a copy
    filled = Parameters(
        np.where(is_copy, 0.0, own.start[sources]),
        transition,
        own.observation[:, rows],
        own.reward[:, sources],
    )
    shown = ["_".join((*learnt.space.values[v], *([str(n)] if max(numbers) > 1 else []))) for v, n in wanted]
    return format_pomdp(make_pomdp(learnt.episodes, shown, filled, learnt.discount))


def _format_toml(name: str, learnt: LearntModel) -> str:
    variables, phases = learnt.space.variables, max(learnt.model.structure.numbers)
    states = "_".join(f"{{{variable}}}" for variable in (*variables, *(["phase"] if phases > 1 else [])))
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
        f"reports = {json.dumps(learnt.space.pattern)}",
    ]
    if phases > 1:
        values = json.dumps([str(n) for n in range(1, phases + 1)])
        lines += ["", "[planning.local.phase]            # what follows from actions", f"values = {values}"]
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
