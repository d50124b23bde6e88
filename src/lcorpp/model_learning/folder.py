"""The folder of a learnt model: the model and a report, and with reports a domain that runs."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from lcorpp.domains.new_domain import check_name
from lcorpp.domains.new_folder import write_folder
from lcorpp.errors import DataError
from lcorpp.model_learning.baum_welch import Parameters
from lcorpp.model_learning.episodes import Episodes
from lcorpp.model_learning.knowledge.knowledge import FILE, Knowledge
from lcorpp.model_learning.knowledge.writing import describe_knowledge, format_program
from lcorpp.model_learning.learnt_model import OVER, LearntModel, make_pomdp
from lcorpp.model_learning.report import format_report
from lcorpp.model_learning.returns import LearntReturn
from lcorpp.model_learning.spaces import Space
from lcorpp.planning import Pomdp, SparseTables, format_pomdp


def write_model(folder: Path, learnt: LearntModel, expected: LearntReturn | None = None) -> None:
    """Write a learnt model completely or not at all. expected: its return, for the report.

    interaction.pomdp and report.md; of a model with reports also domain.toml and knowledge.plog. A domain has
    as many states of each shared value: those that are missing are copies that nothing reaches.

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
    texts = {"report.md": format_report(learnt, expected)}
    if learnt.knowledge is not None:
        texts["interaction.pomdp"] = _format_filled(learnt)
        texts["domain.toml"] = _format_toml(folder.absolute().name, learnt, learnt.knowledge)
        texts[FILE] = format_program(learnt.knowledge)
    else:
        texts["interaction.pomdp"] = format_pomdp(learnt.pomdp)
    write_folder(folder, texts)


def write_knowledge(folder: Path, knowledge: Knowledge) -> None:
    """Write learnt knowledge completely or not at all: knowledge.plog and report.md.

    Raises:
        DomainError: the folder is not empty.
        FileError: it cannot be written.

    Examples:
        >>> from pathlib import Path
        >>> from lcorpp.model_learning import learn_knowledge, write_knowledge
        >>> sun, rain = {"weather": "sun", "umbrella": "no"}, {"weather": "rain", "umbrella": "yes"}
        >>> write_knowledge(Path("weather"), learn_knowledge(30 * [sun] + 10 * [rain]))
        >>> "pr(umbrella=no | weather=rain) = " in Path("weather/knowledge.plog").read_text()
        True
    """
    report = ["# Learnt knowledge", "", *describe_knowledge(knowledge)]
    write_folder(folder, {FILE: format_program(knowledge), "report.md": "\n".join(report) + "\n"})


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
        states = ["_".join(value) for value in space.values]
        for n, name in enumerate(states):
            if name == OVER or name in states[:n]:
                raise DataError(
                    f"the shared values {', '.join(space.values[n])} would be the state {name}, which is"
                    f" {'the end of a decision' if name == OVER else 'that of others'}; expected another name"
                )


def _format_filled(learnt: LearntModel) -> str:
    """Return the model with equally many states of each value, in the order of the values."""
    structure, own = learnt.model.structure, learnt.plan
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
    reward = learnt.find_rewards(own)[:, sources]
    return format_pomdp(make_pomdp(learnt.episodes, shown, filled, reward, learnt.discount))


def _format_toml(name: str, learnt: LearntModel, knowledge: Knowledge) -> str:
    variables, phases, stated = learnt.space.variables, max(learnt.model.structure.numbers), learnt.stated
    attributes = [*knowledge.cases.names, *knowledge.cases.constants]
    senses = [own for own in (stated.senses if stated else ()) if {own.attribute, own.of} <= set(attributes)]
    others = {*variables, *knowledge.cases.hidden, *(sense.attribute for sense in senses)}
    observed = [own for own in attributes if own not in others]
    states = "_".join(f"{{{variable}}}" for variable in (*variables, *(["phase"] if phases > 1 else [])))
    what = f"{len(learnt.episodes)} episodes" if stated is None else f"decisions in the domain {stated.name}"
    lines = [
        "# Learnt by `lcorpp model`; report.md has the interval of each number.",
        f"name = {json.dumps(name)}",
        f"description = {json.dumps(f'Learnt from {what}.')}",
        "",
        "[reasoning]",
        f"program = {json.dumps(FILE)}",
        f"observed = {json.dumps(observed)}",
        f"shared = {json.dumps(list(variables))}",
    ]
    for sense in senses:
        labels = ", ".join(f"{json.dumps(own)} = {json.dumps(of)}" for of, own in sense.label_of.items())
        lines += [
            "",
            "[[learning]]",
            f"name = {json.dumps(sense.name)}",
            f"attribute = {json.dumps(sense.attribute)}",
            f"labels = {{ {labels} }}",
            'classifier = "channel"            # simulated, with the rates of the knowledge',
        ]
    lines += [
        "",
        "[planning]",
        'model = "interaction.pomdp"',
        f"states = {json.dumps(states)}",
        f"terminal = {json.dumps(OVER)}",
        *_list_reports(learnt),
    ]
    if phases > 1:
        values = json.dumps([str(n) for n in range(1, phases + 1)])
        lines += ["", "[planning.local.phase]            # what follows from actions", f"values = {values}"]
    return "\n".join(lines) + "\n"


def _list_reports(learnt: LearntModel) -> Iterator[str]:
    """Yield the pattern of the reports, or the value that each report names."""
    space = learnt.space
    if space.pattern:
        yield f"reports = {json.dumps(space.pattern)}"
        return
    yield from ("", "[planning.reports]")
    all_right = (1 << len(space.variables)) - 1
    for action, rights in zip(learnt.episodes.action_names, space.reports.tolist(), strict=True):
        if all_right in rights:
            value = space.values[rights.index(all_right)]
            yield f"{json.dumps(action)} = {json.dumps(value[0] if len(value) == 1 else list(value))}"
