"""`lcorpp simulate`: the discounted reward of a policy in simulated episodes."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lcorpp.cli import model_files
from lcorpp.cli.console import print_text
from lcorpp.cli.options import common as options
from lcorpp.errors import PolicyError

if TYPE_CHECKING:
    from lcorpp.planning import Evaluation, Policy, Pomdp, SimulationResult
    from lcorpp.planning.evaluation.simulation import Trace

NEGLIGIBLE = 1e-4
"""Episodes are cut off when the discount has fallen to this, if they have not ended."""

CONFIDENCE = 1 - 1e-6
"""Confidence with which a simulation contradicts a policy: chance refuses one right policy in a million."""

MAX_NODES = 1000
"""Beliefs of the evaluation beside the simulation; it takes about as long as the simulation."""


def simulate(
    model: model_files.ModelArgument,
    policy: Annotated[Path, typer.Argument(metavar="POLICY", help="A .policy, .xml or .alpha file for it.")],
    trials: Annotated[int, typer.Option(min=1, max=options.MAX_TRIALS, help="Number of episodes.")] = 100_000,
    steps: Annotated[
        int | None,
        typer.Option(
            min=1,
            max=options.MAX_STEPS,
            help="Maximum length of an episode; by default until the discount is 0.0001.",
        ),
    ] = None,
    seed: options.SeedOption = 0,
    trace: Annotated[
        int, typer.Option(min=0, metavar="K", help="Print the first K episodes step by step.")
    ] = 0,
) -> None:
    """Simulate a policy and compare its mean reward with the bounds.

    Prints the mean discounted reward with its 95% interval, the policy's lower bound and its evaluated value.
    The exit code is 2 if the policy earns less than its lower bound.
    """
    from lcorpp.planning import evaluate, simulate as simulate_policy
    from lcorpp.planning.formats.model_file import read_model

    pomdp, problem = read_model(model)
    tested = model_files.read_policy(policy, pomdp, problem)
    max_steps = steps or _find_max_steps(pomdp)
    result = simulate_policy(pomdp, tested, trials=trials, steps=max_steps, seed=seed, traces=trace)
    value = evaluate(pomdp, tested, max_nodes=MAX_NODES, trials=0)
    for number, episode in enumerate(result.traces, start=1):
        _print_episode(pomdp, number, episode)
    low, high = result.interval.low, result.interval.high
    print_text(f"{model.name}: {trials} episodes of at most {max_steps} steps, seed {seed}")
    interval = f"   95% interval [{low:.6g}, {high:.6g}]" if trials > 1 else "   (one episode: no interval)"
    print_text(f"  mean discounted reward   {result.mean:.6g}{interval}")
    claim = tested.value(pomdp.start)
    print_text(f"  policy's lower bound     {claim:.6g}{_describe_horizon(tested)}")
    bounds = f"[{value.lower:.6g}, {value.upper:.6g}]"
    print_text(f"  policy's value           {bounds}, evaluated on {value.beliefs} beliefs")
    comparison = _compare(result, value) if trials > 1 else None
    if comparison is not None:
        print_text(f"  {comparison}")
    if result.unfinished:
        min_change, max_change = result.truncation
        change = f"truncation changes the mean by {min_change:.4g} to {max_change:.4g}"
        print_text(f"  {result.unfinished} episodes were cut off; {change}")
    speed = result.steps / max(result.seconds, 1e-9)
    print_text(f"  {result.steps} steps in {result.seconds:.2f} s: {speed:.3g} steps per second")
    if tested.horizon is None:
        _check_claim(policy, claim, result, value)


def _describe_horizon(policy: Policy) -> str:
    if policy.horizon is None:
        return ""
    return f" for {policy.horizon} remaining steps; the simulation uses the vectors in every step"


def _check_claim(policy: Path, claim: float, result: SimulationResult, value: Evaluation) -> None:
    """Compare the claimed value at the start with the evaluated and the simulated one.

    The evaluation gives certain bounds. The simulation contradicts the claim if a bound with the confidence
    `CONFIDENCE` that holds for any distribution of rewards is below it; its 95% interval would refuse right
    policies by chance, and miss rewards that are too rare to occur.

    Raises:
        PolicyError: one of them contradicts the claim.
    """
    from lcorpp.planning.evaluation.claims import RELATIVE_TOLERANCE

    tolerance = RELATIVE_TOLERANCE * max(abs(claim), abs(value.upper))
    limit = result.upper_limit(CONFIDENCE)
    start = f"{policy}: the policy's vectors promise {claim:.6g} at the start belief, but it earns at most"
    if value.upper < claim - tolerance:
        raise PolicyError(f"{start} {value.upper:.6g}, by the evaluation")
    if limit < claim - tolerance:
        raise PolicyError(f"{start} {limit:.6g}, by the simulation, with confidence {100 * CONFIDENCE:.6g}%")
    if result.interval.high + result.truncation[1] < claim - tolerance:
        print_text("  the interval is below the policy's lower bound, maybe by chance; more trials decide")


def _find_max_steps(pomdp: Pomdp) -> int:
    """Return the number of steps after which further rewards are negligible."""
    if pomdp.discount == 0:
        return 1
    if pomdp.discount < 1:
        return math.ceil(math.log(NEGLIGIBLE) / math.log(pomdp.discount))
    from lcorpp.planning.undiscounted import DiscountedForm

    return DiscountedForm.of(pomdp).find_max_steps(NEGLIGIBLE)


def _compare(result: SimulationResult, value: Evaluation) -> str | None:
    """Explain a mean outside of the bounds on the policy's value; None if it lies between them."""
    min_change, max_change = result.truncation

    def overlaps(low: float, high: float) -> bool:
        return value.lower <= high + max_change and low + min_change <= value.upper

    if overlaps(result.mean, result.mean):
        return None
    if overlaps(result.interval.low, result.interval.high):
        return "the mean differs from the policy's value by sampling error: the interval contains the value"
    return "the interval misses the policy's value, as one interval in 20 does by chance"


def _print_episode(pomdp: Pomdp, number: int, episode: Trace) -> None:
    """Print an episode as a table."""
    rows = [("step", "state", "action", "observation", "reward", "discounted so far")]
    total, discount = 0.0, 1.0
    for step, (action, observation, reward) in enumerate(
        zip(episode.actions.tolist(), episode.observations.tolist(), episode.rewards.tolist(), strict=True)
    ):
        total += discount * reward
        discount *= pomdp.discount
        names = (pomdp.states[episode.states[step]], pomdp.actions[action], pomdp.observations[observation])
        rows.append((str(step + 1), *names, f"{reward:g}", f"{total:.6g}"))
    print_text(f"episode {number}")
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        cells = (
            f"{cell:>{width}}" if column in (0, 4, 5) else f"{cell:<{width}}"
            for column, (cell, width) in enumerate(zip(row, widths, strict=True))
        )
        print_text(("  " + "  ".join(cells)).rstrip())
    print_text(f"  ends in {pomdp.states[episode.states[-1]]}\n")
