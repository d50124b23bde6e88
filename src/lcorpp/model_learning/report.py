"""A learnt model as text: what each action does, with the 95 % interval of each number."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from lcorpp.model_learning.learnt_model import LearntModel
from lcorpp.model_learning.structure import MOVES, RESTARTS, STAYS

EFFECTS = {
    STAYS: "leaves the state as it is",
    RESTARTS: "draws the state again, as at the start",
    MOVES: "changes the state",
}

MIN_STEPS = 1.0
"""A number that would be estimated from fewer expected steps is not identifiable."""

MIN_PROBABILITY = 0.005
"""Smaller probabilities are left out of the report, in which they are 0.00."""

NOT_IDENTIFIABLE = "not identifiable from these data"


def format_report(learnt: LearntModel) -> str:
    """Return the report as Markdown.

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
        f"{len(episodes)} episodes, {len(episodes.actions)} steps; {len(learnt.states)} states, chosen by the"
        " Bayesian information criterion. Numbers are estimates with 95 % intervals, given this choice of"
        f" states. A number of fewer than {MIN_STEPS:g} expected steps is {NOT_IDENTIFIABLE}; the model has"
        " there what the action does on average.",
        "",
        "## Start",
        "",
        *_list_start(learnt),
    ]
    for action, name in enumerate(episodes.action_names):
        lines += ["", f"## {name}", "", *_describe_action(learnt, action)]
    return "\n".join(lines) + "\n"


def _list_start(learnt: LearntModel) -> Iterator[str]:
    start = learnt.model.parameters.start
    for k in np.flatnonzero(start >= MIN_PROBABILITY):
        low, high = learnt.find_interval(lambda own, k=k: own.start[k])  # type: ignore[misc]
        yield f"- {learnt.states[k]}: {start[k]:.2f} [{low:.2f}, {high:.2f}]"


def _describe_action(learnt: LearntModel, action: int) -> Iterator[str]:
    parameters, effect = learnt.model.parameters, int(learnt.model.structure.effects[action])
    count, K = int(np.count_nonzero(learnt.episodes.actions == action)), len(learnt.states)
    ends = learnt.steps.transition[action, :, K].sum() / max(learnt.steps.transition[action].sum(), 1e-9)
    always = ends > 1 - MIN_PROBABILITY
    does = "ends the decision" if always else EFFECTS[effect]
    if MIN_PROBABILITY < ends <= 1 - MIN_PROBABILITY:
        does += f", or ends the decision ({ends:.2f})"
    yield f"{count} steps. It {does}."
    if effect == MOVES and not always:
        yield ""
        for k, rows in enumerate(parameters.transition[action]):
            if learnt.steps.transition[action, k].sum() < MIN_STEPS:
                yield f"- from {learnt.states[k]}: {NOT_IDENTIFIABLE}"
                continue
            names = (*learnt.states, "the end")
            parts = [f"{names[n]} {rows[n]:.2f}" for n in np.argsort(-rows) if rows[n] >= MIN_PROBABILITY]
            yield f"- from {learnt.states[k]} to {', '.join(parts)}"
    yield ""
    tables = [("reward", learnt.model.structure.reward, learnt.steps.reward, _describe_reward)]
    if not always:
        seen = learnt.steps.observation[:, :K]
        tables.append(("observations", learnt.model.structure.observation, seen, _describe_observations))
    for what, groups, steps, describe in tables:
        counts = steps[action].sum(axis=1)
        for group in dict.fromkeys(groups[action].tolist()):
            states = np.flatnonzero((groups[action] == group) & (counts >= MIN_STEPS)).tolist()
            if states:
                yield f"- {what} {_name(learnt, states)}: {describe(learnt, action, states[0])}"
        if unseen := np.flatnonzero(counts < MIN_STEPS).tolist():
            yield f"- {what} {_name(learnt, unseen)}: {NOT_IDENTIFIABLE}"


def _describe_reward(learnt: LearntModel, action: int, state: int) -> str:
    mean = learnt.find_reward(learnt.model.parameters, action, state)
    low, high = learnt.find_interval(lambda own: learnt.find_reward(own, action, state))
    return f"{mean:.4g} [{low:.4g}, {high:.4g}]"


def _describe_observations(learnt: LearntModel, action: int, state: int) -> str:
    parts, row = list[str](), learnt.model.parameters.observation[action, state]
    for o in np.argsort(-row, kind="stable"):
        if row[o] >= MIN_PROBABILITY:
            low, high = learnt.find_interval(lambda own, o=o: own.observation[action, state, o])  # type: ignore[misc]
            parts.append(f"{learnt.episodes.observation_names[o]} {row[o]:.2f} [{low:.2f}, {high:.2f}]")
    return ", ".join(parts)


def _name(learnt: LearntModel, states: list[int]) -> str:
    if len(states) == len(learnt.states):
        return "in each state"
    return "in " + " and ".join(learnt.states[k] for k in states)
