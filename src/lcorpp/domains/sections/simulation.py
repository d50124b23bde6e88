"""The `[simulation]` section of a domain: true distribution, motion and feedback of simulated people."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lcorpp.domains.plugin import SimulationPlugin
from lcorpp.domains.sections.learning import LearningSection
from lcorpp.domains.sections.names import check_declared, check_same_names, find_attribute_values
from lcorpp.domains.sections.planning import PlanningSection
from lcorpp.domains.sections.reasoning import ReasoningSection
from lcorpp.domains.toml import TomlTable
from lcorpp.errors import DomainError
from lcorpp.reasoning import Program, read_plog
from lcorpp.values import Array


@dataclass(frozen=True, eq=False, repr=False)
class SimulationSection:
    """Models of simulated people; the robot's own program and POMDP may differ from them.

    true_program: the P-log program from which people are drawn.
    feedback_model: (A, S, O) P(o | a, s') of people's answers.
    noisy_channel: target value -> label -> probability: the error rates of a simulated classifier; None if
        they are unknown, so that classification needs trajectories.
    trajectories: maps people (attribute -> value) and a generator to (people, channels, time points); None
        without a people.py that defines it.
    reaction: maps a person, an action and a generator to an observation, replacing `feedback_model`; None
        without a people.py that defines it.
    recordings: like `trajectories`, with the keyword `seconds` (min, max: the duration); returns one array
        (samples, columns) for each person, as a tracker records it.
    columns: the names of these columns; () without recordings.
    """

    true_program: Program
    feedback_model: Array
    noisy_channel: Mapping[str, Mapping[str, float]] | None
    trajectories: Callable[[Sequence[Mapping[str, str]], np.random.Generator], Array] | None
    reaction: Callable[[Mapping[str, str], str, np.random.Generator], str] | None
    recordings: Callable[..., list[Array]] | None = None
    columns: tuple[str, ...] = ()

    def __repr__(self) -> str:
        parts = {
            "noisy channel": self.noisy_channel,
            "trajectories": self.trajectories,
            "reaction": self.reaction,
            "recordings": self.recordings,
        }
        defined = ", ".join(name for name, part in parts.items() if part is not None)
        return f"SimulationSection({self.true_program!r}, defines: {defined or 'nothing'})"


def read_simulation(
    table: TomlTable,
    folder: Path,
    reasoning: ReasoningSection,
    learning: LearningSection,
    planning: PlanningSection,
) -> SimulationSection:
    """Read the section, the true program and the plug-in.

    Raises:
        DomainError: the true program has other values than the robot's, or a name is unknown.
    """
    program = read_plog(folder / table.text("truth")) if "truth" in table else reasoning.program
    for name in (reasoning.target, *reasoning.observed):
        values = find_attribute_values(table.location("truth"), name, program)
        robot_attribute = reasoning.program.attributes[name]
        what = f"the values of {name} at {reasoning.program.file}:{robot_attribute.line}"
        location = f"{program.file}:{program.attributes[name].line}"
        check_same_names(location, values, robot_attribute.values, what)
    plugin = SimulationPlugin(folder / table.text("people")) if "people" in table else None
    section = SimulationSection(
        true_program=program,
        feedback_model=_make_feedback_model(table, reasoning, planning),
        noisy_channel=_make_noisy_channel(table, program, reasoning, learning),
        trajectories=plugin.trajectories if plugin and plugin.defines("trajectory", "trajectories") else None,
        reaction=plugin.reaction if plugin and plugin.defines("reaction") else None,
        recordings=plugin.recordings if plugin and plugin.defines("recordings") else None,
        columns=plugin.columns if plugin else (),
    )
    table.reject_unknown_keys()
    return section


def _make_feedback_model(table: TomlTable, reasoning: ReasoningSection, planning: PlanningSection) -> Array:
    """Return P(o | a, s') (A, S, O): from `feedback` and `noise`, else the planner's observation model."""
    pomdp = planning.pomdp
    noise = table.number("noise", 0, 1, 0)
    if "feedback" not in table:
        if noise:
            raise DomainError(f"{table.location('noise')}: `noise` requires `feedback`")
        return pomdp.observation.dense
    answer_probabilities = _compute_answer_probabilities(table, noise, reasoning, planning)
    model = pomdp.observation.dense.copy()
    states = planning.state_values.any(axis=1)  # (S,) not the terminal state, which has no target value
    for a, action in enumerate(pomdp.actions):
        if action in planning.reports:
            continue
        model[a, states] = planning.state_values[states] @ answer_probabilities
        expected = pomdp.observation.dense[a, states].max(axis=0) > 0
        impossible = (model[a, states].max(axis=0) > 0) & ~expected
        if impossible.any():
            observation = pomdp.observations[int(np.argmax(impossible))]
            raise DomainError(
                f"{table.location('feedback')}: people may answer {observation!r} to {action!r}, but"
                f" {pomdp.file} gives it probability 0 in every state"
            )
    return model


def _compute_answer_probabilities(
    table: TomlTable, noise: float, reasoning: ReasoningSection, planning: PlanningSection
) -> Array:
    """Return P(o | v) (V, O): the feedback of value v with probability 1 - noise, else another answer."""
    pomdp = planning.pomdp
    feedback = table.mapping("feedback")
    what = f"the values of {reasoning.target}"
    check_same_names(table.location("feedback"), tuple(feedback), reasoning.values, what)
    for value, observation in feedback.items():
        check_declared(table.location("feedback", value), observation, pomdp, "observations")
    answers = list(dict.fromkeys(feedback.values()))
    if noise and len(answers) < 2:
        raise DomainError(f"{table.location('noise')}: noise needs at least two different answers")
    probabilities = np.zeros((len(reasoning.values), len(pomdp.observations)))
    for v, value in enumerate(reasoning.values):
        for answer in answers:
            p = 1 - noise if answer == feedback[value] else noise / (len(answers) - 1)
            probabilities[v, pomdp.observations.index(answer)] = p
    return probabilities


def _make_noisy_channel(
    table: TomlTable, true_program: Program, reasoning: ReasoningSection, learning: LearningSection
) -> dict[str, dict[str, float]] | None:
    """Return P(label | target value) of the simulated classifier: from `channel`, else the true program."""
    if "channel" in table:
        return _read_noisy_channel(table.section("channel"), table.location("channel"), reasoning, learning)
    if learning.attribute not in true_program.attributes:
        return None
    from lcorpp.reasoning import Reasoner  # imports the grounder and the compiler

    reasoner, labels = Reasoner(true_program), learning.label_of.values()
    marginal = reasoner.posterior(reasoning.target, {})
    return {
        value: {k: float(p) for k, p in reasoner.exact(learning.attribute, {reasoning.target: value}).items()}
        if marginal[value]
        else dict.fromkeys(labels, 1 / len(labels))  # an impossible value: its row is never used
        for value in reasoning.values
    }


def _read_noisy_channel(
    table: TomlTable, location: str, reasoning: ReasoningSection, learning: LearningSection
) -> dict[str, dict[str, float]]:
    """Read the table `channel`: a row of label probabilities for each target value."""
    labels = tuple(learning.label_of.values())
    check_same_names(location, tuple(table), reasoning.values, f"the values of {reasoning.target}")
    rates = {}
    for value in reasoning.values:
        row = table.section(value)
        check_same_names(table.location(value), tuple(row), labels, f"the values of {learning.attribute}")
        rates[value] = {label: row.number(label, 0, 1) for label in labels}
        row.reject_unknown_keys()
        total = sum(rates[value].values())
        if abs(total - 1) > 1e-9:
            raise DomainError(f"{table.location(value)}: the probabilities sum to {total:g}, not 1")
    table.reject_unknown_keys()
    return rates
