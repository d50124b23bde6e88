"""`lcorpp model`: learn a model from episodes or records, and write it as a folder."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from lcorpp.cli.console import print_text
from lcorpp.cli.options import common as options
from lcorpp.errors import DataError

if TYPE_CHECKING:
    from lcorpp.model_learning import Knowledge, LearntModel

EPISODES, RECORDS, LOG = "episodes", "records", "decisions"
"""Kinds of data."""

KINDS = {
    EPISODES: ("--reports", "--facts", "--discount", "--max-states", "--robust"),
    RECORDS: ("--facts",),
    LOG: ("--domain", "--strategy", "--robust"),
}
"""The options that each kind of data has, beside those of all."""

Advance = Callable[[float, str], None]
"""Shows the completed share of the work."""


def model(
    data: Annotated[
        Path,
        typer.Argument(
            metavar="DATA",
            help="Episodes, a row for each step and columns episode, action, observation, reward;"
            " records, a column for each attribute, empty where it is unknown (.csv or .parquet);"
            " or a log of decisions, written with --log.",
        ),
    ],
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="FOLDER", help="The folder, new or empty.")
    ],
    reports: Annotated[
        str | None,
        typer.Option(
            metavar="REPORTS",
            help="The reports, report_{intention} or 'wish: give_tour=tour, stay_away=nothing': the states"
            " are then the values of these variables, and the folder is a domain.",
        ),
    ] = None,
    facts: Annotated[
        str | None,
        typer.Option(
            metavar="NAMES",
            help="Columns of episodes with what is known of them, e.g. time,location; of records, the columns"
            " to read. A shared variable among them has true values.",
        ),
    ] = None,
    hidden: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=VALUES",
            help="A hidden attribute and its values, identity=student,visitor, or their number; repeatable.",
        ),
    ] = None,
    order: Annotated[
        list[str] | None,
        typer.Option(
            metavar="ORDER",
            help="No attribute depends on a later one: 'identity < time, location'; repeatable.",
        ),
    ] = None,
    discount: Annotated[
        float | None, typer.Option(help="Discount of the model, from 0 to below 1.  [default: 0.95]")
    ] = None,
    max_states: Annotated[
        int | None,
        typer.Option(min=1, help="Maximum number of states; by default eleven more than shared values."),
    ] = None,
    robust: Annotated[
        float | None,
        typer.Option(
            metavar="Q",
            help="Plan by the numbers, among the estimate and some draws, whose policy has the largest"
            " Q-quantile of returns in all draws, e.g. 0.1.",
        ),
    ] = None,
    domain: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER",
            help="The domain of a log, if it is no longer where it was; by default the log's.",
        ),
    ] = None,
    strategy: Annotated[
        str | None, typer.Option(metavar="NAME", help="Read only the decisions of this strategy of a log.")
    ] = None,
    seed: options.SeedOption = 0,
) -> None:
    """Learn a model from episodes, records or a log.

    From episodes with hidden states: interaction.pomdp and report.md, which has the interval of each number;
    with --reports also a domain.toml and knowledge.plog, so that `lcorpp run FOLDER` decides with it. From
    records: knowledge.plog and report.md, with the probability of each edge. From a log of decisions: all of
    these; states and rewards are those of its domain.
    """
    from lcorpp.cli.console import show_delayed_progress
    from lcorpp.domains.new_folder import check_new_folder
    from lcorpp.model_learning import estimate_return, plan_robustly, write_knowledge, write_model

    check_new_folder(output)
    if robust is not None and not 0 < robust < 1:
        raise DataError(f"--robust is {robust}; expected a number between 0 and 1")
    kind = _find_kind(data)
    given = {
        "--reports": reports,
        "--facts": facts,
        "--discount": discount,
        "--max-states": max_states,
        "--robust": robust,
        "--domain": domain,
        "--strategy": strategy,
    }
    if wrong := [name for name, own in given.items() if own is not None and name not in KINDS[kind]]:
        raise DataError(f"{data}: has {kind}; expected no {wrong[0]}, which is for others")
    names = [name.strip() for name in (facts or "").split(",") if name.strip()]
    about = {"hidden": _read_hidden(hidden or ()), "order": order or (), "seed": seed}
    try:
        with show_delayed_progress("learning") as advance:
            if kind == RECORDS:
                knowledge = _learn_knowledge(data, names, about, advance)
            elif kind == LOG:
                learnt = _learn_from_log(data, domain, strategy, about, advance)
            else:
                own = {"discount": 0.95 if discount is None else discount, "max_states": max_states}
                learnt = _learn_model(data, names, reports, about | own, advance)
        if kind != RECORDS:
            learnt = learnt if robust is None else plan_robustly(learnt, robust)
            expected = estimate_return(learnt)
    except KeyboardInterrupt:
        raise KeyboardInterrupt("interrupted while learning; nothing is written") from None
    if kind == RECORDS:
        write_knowledge(output, knowledge)
        _print_knowledge(knowledge)
        print_text(f"wrote {output}: knowledge.plog; the edges with their probabilities are in report.md")
        return
    write_model(output, learnt, expected)
    n, steps, states = len(learnt.episodes), len(learnt.episodes.actions), len(learnt.states)
    print_text(f"{n} episodes, {steps} steps; {states} states: {', '.join(learnt.states)}")
    if learnt.knowledge is not None:
        _print_knowledge(learnt.knowledge)
    written = " and ".join(["interaction.pomdp", *(["domain.toml"] if learnt.knowledge else [])])
    print_text(f"return of the policy: {expected}")
    print_text(f"wrote {output}: {written}; the numbers with their intervals are in report.md")


def _find_kind(data: Path) -> str:
    from lcorpp.logs.decision_log import is_log
    from lcorpp.model_learning.episodes import is_table_of_episodes

    if is_log(data):
        return LOG
    return EPISODES if is_table_of_episodes(data) else RECORDS


def _learn_knowledge(
    data: Path, names: Sequence[str], about: Mapping[str, Any], advance: Advance
) -> Knowledge:
    from lcorpp.model_learning import learn_knowledge
    from lcorpp.model_learning.episodes import read_facts

    records = read_facts(data, names)
    try:
        return learn_knowledge(records, **about, progress=lambda share: advance(share, "structures"))
    except DataError as error:
        place = "" if str(error).startswith(str(data)) else f"{data}: "
        raise DataError(f"{place}{error}") from None


def _learn_from_log(
    data: Path, domain: Path | None, strategy: str | None, about: Mapping[str, Any], advance: Advance
) -> LearntModel:
    from lcorpp.model_learning import learn_from_log

    return learn_from_log(
        data, folder=domain, strategy=strategy, **about, progress=lambda share: advance(share, "rounds")
    )


def _learn_model(
    data: Path, names: Sequence[str], reports: str | None, about: Mapping[str, Any], advance: Advance
) -> LearntModel:
    from lcorpp.model_learning import learn_model, read_episodes
    from lcorpp.model_learning.folder import check_names

    episodes = read_episodes(data, names)
    check_names(episodes, reports)
    return learn_model(
        episodes,
        reports=reports,
        **about,
        progress=lambda share, states: advance(share, f"{states} states"),
    )


def _read_hidden(texts: Sequence[str]) -> dict[str, tuple[str, ...]]:
    """Return hidden attributes and their values; of a number of values, NAME_1 and so on."""
    found = dict[str, tuple[str, ...]]()
    for text in texts:
        name, _, values = (part.strip() for part in text.partition("="))
        names = tuple(value.strip() for value in values.split(","))
        if values.isdecimal() and name:
            names = tuple(f"{name}_{i + 1}" for i in range(min(int(values), 1000)))
        if not name or len(set(names)) < max(len(names), 2) or not all(names):
            raise DataError(f"--hidden is {text!r}; expected NAME=VALUES with two or more, or NAME=2")
        if name in found:
            raise DataError(f"--hidden has {name} twice; expected it once")
        found[name] = names
    return found


def _print_knowledge(knowledge: Knowledge) -> None:
    """Print what each attribute depends on."""
    for name, parents in knowledge.structure.items():
        if parents:
            print_text(f"{name} depends on {' and '.join(parents)}")
