"""`lcorpp replay`: logged decisions, made again."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from lcorpp.cli import console
from lcorpp.cli.logs import common
from lcorpp.cli.options.code import take_consent
from lcorpp.cli.options.solving import NoCacheOption, find_cache
from lcorpp.errors import DataError

if TYPE_CHECKING:
    from lcorpp.logs.replay import ReplayedDecision


@take_consent
def replay(
    log: common.LogArgument,
    domain: common.LoggedDomainOption = None,
    quiet: Annotated[
        bool, typer.Option("--quiet", "-q", help="Print the changes and the summary only.")
    ] = False,
    no_cache: NoCacheOption = False,
) -> None:
    """Check that logged decisions would be made again.

    The domain's files are read as they are now; a part that has changed since is named. The robot gets the
    facts, labels and observations of the log; its evidence, marginal, prior, actions, beliefs and report must
    be those of the log. Exit code 1: there are differences; 2: lines that cannot be replayed.
    """
    from lcorpp.logs.replay import ChangedPart, replay_log

    count = different = differences = 0
    damaged = list[DataError]()
    for result in replay_log(log, domain, cache=find_cache(no_cache=no_cache)):
        if isinstance(result, ChangedPart):
            console.out.print(f"changed since the log: {result.what}", style="yellow")
        elif isinstance(result, DataError):
            damaged.append(result)
        else:
            count += 1
            different += bool(result.differences)
            differences += len(result.differences)
            if not quiet:
                _print_decision(result)
    if not (count or damaged):
        raise DataError(common.describe_empty(log))
    where = f" in {different} of them" if different else ""
    console.out.print(f"{count} decisions, {differences} differences{where}")
    if damaged:
        raise DataError(common.summarise_damage(damaged, log))
    if different:
        raise typer.Exit(1)


def _print_decision(result: ReplayedDecision) -> None:
    """Print a decision in one line, and what differs below it."""
    from lcorpp.values import format_value

    episode = result.episode
    given = ", ".join(f"{name}={value}" for name, value in episode.evidence.items())
    steps = ", ".join(f"{step.action} {step.observation or ''}".rstrip() for step in episode.steps)
    report = "no report" if episode.report is None else format_value(episode.report)
    console.out.print(f"{result.line}  {result.strategy}: {given or 'no evidence'}: {steps}; {report}")
    for difference in result.differences:
        console.out.print(f"    {difference}", style="red")
