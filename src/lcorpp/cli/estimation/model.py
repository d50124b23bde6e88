"""`lcorpp model`: learn a model from episodes, and write it as a folder."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from lcorpp.cli.console import print_text
from lcorpp.cli.options import common as options


def model(
    episodes: Annotated[
        Path,
        typer.Argument(
            metavar="EPISODES.csv",
            help="The episodes: a row for each step, columns episode, action, observation, reward.",
        ),
    ],
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="FOLDER", help="The folder, new or empty.")
    ],
    reports: Annotated[
        str | None,
        typer.Option(
            metavar="PATTERN",
            help="The reports, report_{intention}: the states are then the values of these variables, and the"
            " folder is a domain.",
        ),
    ] = None,
    discount: Annotated[float, typer.Option(help="Discount of the model, from 0 to below 1.")] = 0.95,
    max_states: Annotated[
        int | None,
        typer.Option(min=1, help="Maximum number of states; by default eleven more than shared values."),
    ] = None,
    seed: options.SeedOption = 0,
) -> None:
    """Learn a planner's model from episodes with hidden states.

    Writes interaction.pomdp and report.md, which has the interval of each number; with --reports also a
    domain.toml and the rates of the shared values, so that `lcorpp run FOLDER` decides with it.
    """
    from lcorpp.cli.console import show_delayed_progress
    from lcorpp.domains.new_folder import check_new_folder
    from lcorpp.model_learning import learn_model, read_episodes, write_model
    from lcorpp.model_learning.folder import check_names

    check_new_folder(output)
    data = read_episodes(episodes)
    check_names(data, reports)
    try:
        with show_delayed_progress("learning") as advance:
            learnt = learn_model(
                data,
                reports=reports,
                discount=discount,
                max_states=max_states,
                seed=seed,
                progress=lambda share, states: advance(share, f"{states} states"),
            )
    except KeyboardInterrupt:
        raise KeyboardInterrupt("interrupted while learning; nothing is written") from None
    write_model(output, learnt)
    names = ", ".join(learnt.states)
    print_text(f"{len(data)} episodes, {len(data.actions)} steps; {len(learnt.states)} states: {names}")
    written = " and ".join(["interaction.pomdp", *(["domain.toml"] if reports else [])])
    print_text(f"wrote {output}: {written}; the numbers with their intervals are in report.md")
