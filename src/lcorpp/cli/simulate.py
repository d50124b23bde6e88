"""`lcorpp simulate`: what a policy earns when it is tried out."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lcorpp.cli import console as show, model_files as models

if TYPE_CHECKING:
    from lcorpp.planning import Pomdp
    from lcorpp.planning.evaluation.simulation import Trace

NEGLIGIBLE = 1e-4
"""A trial is cut off where discounting has left this share of a reward, if it has not ended by itself."""


def simulate(
    model: models.ModelArgument,
    policy: Annotated[Path, typer.Argument(metavar="POLICY", help="A .policy, .xml or .alpha file for it.")],
    trials: Annotated[int, typer.Option("--trials", min=1, help="How many episodes.")] = 10_000,
    steps: Annotated[
        int | None,
        typer.Option(
            "--steps", min=1, help="The longest episode; by default what comes later counts for little."
        ),
    ] = None,
    seed: show.SeedOption = 0,
    trace: Annotated[
        int, typer.Option("--trace", min=0, metavar="K", help="Show the first K episodes step by step.")
    ] = 0,
) -> None:
    """Try a policy out: the mean discounted reward with its 95% interval, beside what the policy promises."""
    from lcorpp.planning.evaluation.simulation import simulate as simulated

    pomdp, problem = models.read_model(model)
    tried = models.read_policy(policy, pomdp, problem)
    longest = steps or math.ceil(math.log(NEGLIGIBLE) / math.log(pomdp.discount))
    found = simulated(pomdp, tried, trials=trials, steps=longest, seed=seed, traces=trace)
    for number, episode in enumerate(found.traces, start=1):
        _tell(pomdp, number, episode)
    low, high = found.interval.low, found.interval.high
    typer.echo(f"{model.name}: {trials} episodes of at most {longest} steps, seed {seed}")
    interval = f"   95% interval {low:.6g} to {high:.6g}" if trials > 1 else "   (one episode: no interval)"
    typer.echo(f"  discounted reward   {found.mean:.6g}{interval}")
    typer.echo(f"  promised at least   {tried.value(pomdp.start):.6g}")
    if found.unfinished:
        least, most = found.truncation
        ahead = f"what they might add moves the mean by {least:.4g} to {most:.4g}"
        typer.echo(f"  {found.unfinished} episodes were cut off; {ahead}")
    speed = found.steps / max(found.seconds, 1e-9)
    typer.echo(f"  {found.steps} steps in {found.seconds:.2f} s: {speed:.3g} steps a second")


def _tell(pomdp: Pomdp, number: int, episode: Trace) -> None:
    """An episode as a table."""
    rows = [("step", "state", "action", "observation", "reward", "discounted so far")]
    total, worth = 0.0, 1.0
    for step, (action, observation, reward) in enumerate(
        zip(episode.actions.tolist(), episode.observations.tolist(), episode.rewards.tolist(), strict=True)
    ):
        total += worth * reward
        worth *= pomdp.discount
        names = (
            pomdp.states[episode.states[step]],
            pomdp.actions[action],
            pomdp.observations[observation],
        )
        rows.append((str(step + 1), *names, f"{reward:g}", f"{total:.6g}"))
    typer.echo(f"episode {number}")
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        cells = (
            f"{cell:>{width}}" if place in (0, 4, 5) else f"{cell:<{width}}"
            for place, (cell, width) in enumerate(zip(row, widths, strict=True))
        )
        typer.echo(("  " + "  ".join(cells)).rstrip())
    typer.echo(f"  ends in {pomdp.states[episode.states[-1]]}\n")
