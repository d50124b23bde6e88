"""A learnt model as text: what each action does, with the 95 % interval of each number."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial

import numpy as np

from lcorpp.model_learning.baum_welch import Parameters
from lcorpp.model_learning.knowledge.writing import NOT_IDENTIFIABLE, describe_knowledge
from lcorpp.model_learning.learnt_model import LearntModel
from lcorpp.model_learning.returns import LearntReturn, find_causes
from lcorpp.model_learning.structure import MOVES, RESTARTS, STAYS
from lcorpp.values import Array

EFFECTS = {
    STAYS: "leaves the state as it is",
    RESTARTS: "draws the state again, as at the start",
    MOVES: "changes the state",
}

MIN_STEPS = 1.0
"""A number that would be estimated from fewer expected steps is not identifiable."""

MIN_PROBABILITY = 0.005
"""Smaller probabilities are left out of the report, in which they are 0.00."""


def format_report(learnt: LearntModel, expected: LearntReturn | None = None) -> str:
    """Return the report as Markdown. expected: the return of the model's policy.

    Examples:
        >>> from lcorpp.model_learning import Episodes, Step, format_report, learn_model
        >>> heads, tails = Step("look", "h", -1), Step("look", "t", -1)
        >>> people = [[heads, Step("say_heads", "none", 5)], [tails, Step("say_heads", "none", -5)],
        ...           [tails, Step("say_tails", "none", 5)], [heads, Step("say_tails", "none", -5)]] * 20
        >>> learnt = learn_model(Episodes.of(people, [True] * 80), reports="say_{side}")
        >>> print(format_report(learnt))
        # Learnt model
        ...
        - observations in heads: h 0.98 [...], t 0.02 [...]
        ...
    """
    episodes = learnt.episodes
    lines = [
        "# Learnt model",
        "",
        *_describe_data(learnt),
        *(["", "## Return", "", *_describe_return(learnt, expected)] if expected else []),
        "",
        "## Start",
        "",
        *_list_start(learnt),
    ]
    for action, name in enumerate(episodes.action_names):
        lines += ["", f"## {name}", "", *_describe_action(learnt, action)]
    if learnt.knowledge is not None and len(learnt.knowledge.cases.names) > 1:
        lines += ["", "## Knowledge", "", *describe_knowledge(learnt.knowledge)]
    return "\n".join(lines) + "\n"


def _describe_data(learnt: LearntModel) -> Iterator[str]:
    episodes, stated, K = learnt.episodes, learnt.stated, len(learnt.states)
    numbers = "Numbers are estimates with 95 % intervals, given this choice of states."
    if stated is None:
        yield (
            f"{len(episodes)} episodes, {len(episodes.actions)} steps; {K} states, chosen by the Bayesian"
            f" information criterion. {numbers} A number of fewer than {MIN_STEPS:g} expected steps is"
            f" {NOT_IDENTIFIABLE}; the model has there what the action does on average."
        )
        return
    yield (
        f"{len(episodes)} decisions of {stated.strategy} with {len(episodes.actions)} answers; {K} states and"
        f" all rewards as the domain {stated.name} states them. {numbers} A number of fewer than"
        f" {MIN_STEPS:g} expected steps is {NOT_IDENTIFIABLE}; the model has there what the domain states."
    )
    if stated.skipped:
        yield ""
    for reason, count in stated.skipped.items():
        yield f"- {count} decisions are left out: {reason}"


def _describe_return(learnt: LearntModel, expected: LearntReturn) -> Iterator[str]:
    plans = "the estimate"
    if learnt.planned is not None:
        plans = "a draw of the numbers, whose policy has the best quantile of returns"
    yield (
        f"Expected return of the policy from the start, discount {learnt.discount:g}: {expected}. The policy"
        f" plans by {plans}, and is evaluated by the estimate and {len(expected.drawn)} draws of the numbers."
        " The interval is given the states and what actions can do; at most"
        f" {expected.unfollowed:.2g} of the return is not followed."
    )
    if causes := find_causes(learnt, expected.drawn):
        yield ""
        yield "The spread of the returns depends on these numbers; record more steps that show them:"
        yield ""
    for what, share in causes:
        yield f"- {what}: {share:.0%} of the variance"


def _list_start(learnt: LearntModel) -> Iterator[str]:
    for part in _format_row(learnt, lambda own: own.start, learnt.states):
        yield f"- {part}"


def _describe_action(learnt: LearntModel, action: int) -> Iterator[str]:
    effect, K = int(learnt.model.structure.effects[action]), len(learnt.states)
    steps = learnt.steps.transition[action]
    if not steps.any():
        yield f"0 steps: as the domain states it, and {NOT_IDENTIFIABLE}."
        return
    count, ends = int(np.count_nonzero(learnt.episodes.actions == action)), steps[:, K].sum() / steps.sum()
    always = ends > 1 - MIN_PROBABILITY
    does = "ends the decision" if always else EFFECTS[effect]
    if MIN_PROBABILITY < ends <= 1 - MIN_PROBABILITY:
        does += ", or ends the decision"
        if effect != MOVES:  # with the same probability in each state
            row = _format_row(learnt, lambda own: own.transition[action, 0, K:], ["probability"])
            does += f", {row[0]}"
    yield f"{count} steps. It {does}."
    if effect == MOVES and not always:
        yield ""
        for k in range(K):
            row = _format_row(learnt, partial(_get_transitions, action, k), (*learnt.states, "the end"))
            found = ", ".join(row) if steps[k].sum() >= MIN_STEPS else NOT_IDENTIFIABLE
            yield f"- from {learnt.states[k]} to {found}"
    yield ""
    tables = [] if learnt.stated is not None else [("reward", learnt.steps.reward, _describe_reward)]
    if not always:
        tables.append(("observations", learnt.steps.observation[:, :K], _describe_observations))
    for what, steps, describe in tables:
        texts: dict[str, list[int]] = {}
        for k, count in enumerate(steps[action].sum(axis=1)):
            text = describe(learnt, action, k) if count >= MIN_STEPS else NOT_IDENTIFIABLE
            texts.setdefault(text, []).append(k)
        for text, states in texts.items():
            yield f"- {what} {_name(learnt, states)}: {text}"


def _describe_reward(learnt: LearntModel, action: int, state: int) -> str:
    mean = learnt.find_rewards(learnt.model.parameters)[action, state]
    low, high = learnt.find_interval(lambda own: learnt.find_rewards(own)[action, state])
    return f"{mean:.4g} [{low:.4g}, {high:.4g}]"


def _describe_observations(learnt: LearntModel, action: int, state: int) -> str:
    names = learnt.episodes.observation_names
    return ", ".join(_format_row(learnt, lambda own: own.observation[action, state], names))


def _get_transitions(action: int, state: int, parameters: Parameters) -> Array:
    rows: Array = parameters.transition[action, state]
    return rows


def _format_row(learnt: LearntModel, row: Callable[[Parameters], Array], names: Sequence[str]) -> list[str]:
    """Return the probabilities of a row of a table with their intervals, the largest ones first."""
    estimate, (low, high) = row(learnt.model.parameters), learnt.find_interval(row)
    return [
        f"{names[i]} {estimate[i]:.2f} [{low[i]:.2f}, {high[i]:.2f}]"
        for i in np.argsort(-estimate, kind="stable")
        if estimate[i] >= MIN_PROBABILITY
    ]


def _name(learnt: LearntModel, states: list[int]) -> str:
    if len(states) == len(learnt.states):
        return "in each state"
    return "in " + " and ".join(learnt.states[k] for k in states)
