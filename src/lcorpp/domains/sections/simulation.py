"""The `[simulation]` section of a domain: true distribution, motion and feedback of simulated people."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from lcorpp.domains.plugin import SimulationPlugin
from lcorpp.domains.sections.files import find_file, find_function
from lcorpp.domains.sections.learning import Sense
from lcorpp.domains.sections.names import (
    check_declared,
    check_defined,
    check_same_names,
    find_attribute_values,
)
from lcorpp.domains.sections.noisy_channels import make_noisy_channels
from lcorpp.domains.sections.planning import PlanningSection
from lcorpp.domains.sections.reasoning import ReasoningSection, read_value_mapping
from lcorpp.domains.toml import TomlTable
from lcorpp.errors import DomainError
from lcorpp.planning import Pomdp, SparseTables
from lcorpp.protocols import World
from lcorpp.reasoning import Program, read_plog
from lcorpp.values import Array

if TYPE_CHECKING:
    from lcorpp.domains.sections.presence import Presence

Simulate = Callable[[Sequence[Mapping[str, str]], np.random.Generator], Array]
"""Maps people (attribute -> value) and a generator to the signals of a sense, one for each person."""


@dataclass(frozen=True, eq=False, repr=False)
class SimulationSection:
    """Models of simulated people; the robot's own program and POMDP may differ from them.

    true_program: the P-log program from which people are drawn.
    feedback_model: (A, S, O) P(o | a, s') of people's answers; empty for a generative model.
    hearing: (A, O, O) P(heard | said) of the answers, by `noise`; the identity without `feedback`. Empty as
        above.
    limit_models: like `feedback_model`, for each noise of `PlanningSection.limit_noise`.
    transition: P(s' | s, a) if it depends on people's answers, which the planner expects to be others; None
        as the planner expects.
    noisy_channels: sense -> class -> label -> probability: the error rates of a simulated classifier; a sense
        is missing if they are unknown, so that its classification needs signals.
    joint_labels: the senses with a noisy channel whose labels the truth program draws with the person, as it
        relates them to more than their class; the others are drawn by their rates.
    presence: sense -> the people whom it perceives; a sense that is missing perceives all.
    signals: sense -> the simulation of its signals, e.g. trajectories (people, channels, time points), for
        the senses for which a people.py defines it.
    world: makes the world of a person, from the person and a generator; its answers replace
        `feedback_model`. None without an own world and without reaction() in people.py.
    recordings: like `signals` of the motion, with the keyword `seconds` (min, max: the duration); returns one
        array (samples, columns) for each person, as a tracker records it.
    columns: the names of these columns; () without recordings.

    Examples:
        >>> from lcorpp import load_domain
        >>> load_domain("intention").simulation.noisy_channels["motion"]["interested"]
        {'one': 0.76, 'zero': 0.24}
    """

    true_program: Program
    feedback_model: Array
    hearing: Array
    noisy_channels: Mapping[str, Mapping[str, Mapping[str, float]]] = field(default_factory=dict)
    joint_labels: tuple[str, ...] = ()
    presence: Mapping[str, Presence] = field(default_factory=dict)
    signals: Mapping[str, Simulate] = field(default_factory=dict)
    world: Callable[[Mapping[str, str], np.random.Generator], World] | None = None
    recordings: Callable[..., list[Array]] | None = None
    columns: tuple[str, ...] = ()
    transition: SparseTables | None = None
    limit_models: tuple[Array, ...] = ()

    def __repr__(self) -> str:
        parts = {
            "noisy channels": self.noisy_channels,
            "signals": self.signals,
            "world": self.world,
            "recordings": self.recordings,
        }
        defined = ", ".join(name for name, part in parts.items() if part)
        return f"SimulationSection({self.true_program!r}, defines: {defined or 'nothing'})"


def read_simulation(
    table: TomlTable,
    folder: Path,
    reasoning: ReasoningSection,
    senses: Sequence[Sense],
    planning: PlanningSection,
) -> SimulationSection:
    """Read the section, the true program and the plug-in.

    Raises:
        DomainError: the true program has other values than the robot's, or a name is unknown.
    """
    program = read_truth(table, folder, reasoning, senses)
    plugin = None
    if "people" in table:
        plugin = SimulationPlugin(find_file(table, "people", folder), [sense.name for sense in senses])
    if isinstance(planning.model, Pomdp):
        noise = table.number("noise", 0, 1, 0)
        feedback_model, hearing = _make_feedback_model(table, noise, reasoning, planning)
    else:
        table.reject_keys(("feedback", "noise"), f"{planning.model.file} simulates the answers")
        feedback_model = hearing = np.zeros((0, 0, 0))
    channels, joint = make_noisy_channels(table, program, senses)
    section = SimulationSection(
        true_program=program,
        feedback_model=feedback_model,
        hearing=hearing,
        noisy_channels=channels,
        joint_labels=joint,
        presence=_read_presence(table.section("present"), program, senses),
        signals=plugin.signals if plugin else {},
        world=_read_world(table, folder, plugin),
        recordings=plugin.recordings if plugin and plugin.defines("recordings") else None,
        columns=plugin.columns if plugin else (),
        limit_models=_make_limit_models(table, reasoning, planning),
    )
    table.reject_unknown_keys()
    return section


def _make_limit_models(
    table: TomlTable, reasoning: ReasoningSection, planning: PlanningSection
) -> tuple[Array, ...]:
    """Return P(o | a, s') with each noise for which the limits hold."""
    if planning.limit_noise and "feedback" not in table:
        raise DomainError(f"{table.location('feedback')} is missing; expected it beside planning.limit_noise")
    return tuple(_make_feedback_model(table, n, reasoning, planning)[0] for n in planning.limit_noise)


def read_truth(
    table: TomlTable, folder: Path, reasoning: ReasoningSection, senses: Sequence[Sense]
) -> Program:
    """Read the program from which people are drawn, by default the robot's.

    Raises:
        DomainError: it has other values than the robot's.
    """
    program = reasoning.program
    file = find_file(table, "truth", folder) if "truth" in table else None
    if file is not None and str(file) != program.file:
        program = read_plog(file)
    for name in dict.fromkeys([*reasoning.shared, *[sense.of for sense in senses], *reasoning.observed]):
        values = find_attribute_values(table.location("truth"), name, program)
        what = f"the values of {name} at {reasoning.locate(name)}"
        location = f"{program.file}:{program.attributes[name].line}"
        check_same_names(location, values, reasoning.program.attributes[name].values, what)
    if program is not reasoning.program:
        predicted = [sense.attribute for sense in senses if sense.attribute in program.attributes]
        defined = (*reasoning.shared, *[sense.of for sense in senses], *predicted)
        check_defined(table.location("truth"), defined, program)
    return program


def _read_world(
    table: TomlTable, folder: Path, plugin: SimulationPlugin | None
) -> Callable[[Mapping[str, str], np.random.Generator], World] | None:
    """Return the worlds of the key `world`, else of reaction() in people.py, else None."""
    if "world" not in table:
        return plugin.make_world if plugin and plugin.defines("reaction") else None
    parts = find_function(table, "world", folder)
    if parts is None:
        raise DomainError(f"{table.location('world')}: expected FILE.py:NAME, not {table.text('world')!r}")
    from lcorpp.domains.own_world import OwnWorlds  # few domains have worlds of their own

    return OwnWorlds(*parts)


def _make_feedback_model(
    table: TomlTable, noise: float, reasoning: ReasoningSection, planning: PlanningSection
) -> tuple[Array, Array]:
    """Return P(o | a, s') (A, S, O) and P(heard | said) (A, O, O) with a noise.

    They follow from `feedback` and `noise`; without, people answer by the planner's observation model.
    """
    pomdp = planning.pomdp
    hearing = np.tile(np.eye(len(pomdp.observations)), (len(pomdp.actions), 1, 1))
    if "feedback" not in table:
        if noise:
            raise DomainError(f"{table.location('noise')}: `noise` requires `feedback`")
        return pomdp.observation.dense, hearing
    feedback = _read_feedback(table, reasoning, planning)
    model = pomdp.observation.dense.copy()
    states = planning.state_values.any(axis=1)  # (S,) not the terminal state, which has no shared value
    for a, action in enumerate(pomdp.actions):
        if action in planning.reports:
            continue
        answers = _compute_answer_probabilities(table, noise, feedback[action], pomdp)
        said = [pomdp.observations.index(answer) for answer in feedback[action]]
        hearing[a, said] = answers
        model[a, states] = planning.state_values[states] @ answers
        expected = pomdp.observation.dense[a, states].max(axis=0) > 0
        impossible = (model[a, states].max(axis=0) > 0) & ~expected
        if impossible.any():
            observation = pomdp.observations[int(np.argmax(impossible))]
            raise DomainError(
                f"{table.location('feedback')}: people may answer {observation!r} to {action!r}, but"
                f" {pomdp.file} gives it probability 0 in every state"
            )
    return model, hearing


def _read_feedback(
    table: TomlTable, reasoning: ReasoningSection, planning: PlanningSection
) -> dict[str, tuple[str, ...]]:
    """Read `feedback`: question -> the answer of a person of each shared value, in their order.

    Of one shared variable it maps the values to answers, whatever the question. Of several it is a table of
    the questions: each has a template of its answer, or the answer by the values of one variable.
    """
    pomdp, location = planning.pomdp, table.location("feedback")
    questions = tuple(action for action in pomdp.actions if action not in planning.reports)
    if len(reasoning.shared) == 1:
        answer_of, what = table.mapping("feedback"), f"the values of {reasoning.shared[0]}"
        check_same_names(
            location, tuple(answer_of), reasoning.program.attributes[reasoning.shared[0]].values, what
        )
        for value, answer in answer_of.items():
            check_declared(table.location("feedback", value), answer, pomdp, "observations")
        return dict.fromkeys(questions, tuple(answer_of[str(value)] for value in reasoning.values))
    given = table.section("feedback")
    check_same_names(location, tuple(given), questions, f"the questions of {pomdp.file}")
    return {question: _read_answers(given, question, reasoning, pomdp) for question in questions}


def _read_answers(
    table: TomlTable, question: str, reasoning: ReasoningSection, pomdp: Pomdp
) -> tuple[str, ...]:
    """Read the answers to a question: a template, or a table of one variable."""
    location, people = table.location(question), [reasoning.split(value) for value in reasoning.values]
    if table.is_text(question):
        template = table.text(question)
        try:
            answers = tuple(template.format_map(person) for person in people)
        except (LookupError, ValueError, AttributeError) as error:
            raise DomainError(
                f"{location}: {template!r}: {error}; expected names of shared variables in braces:"
                f" {', '.join(reasoning.shared)}"
            ) from None
    else:
        variable, answer_of = read_value_mapping(table.section(question), reasoning)
        answers = tuple(answer_of[person[variable]] for person in people)
    for answer in dict.fromkeys(answers):
        check_declared(location, answer, pomdp, "observations")
    return answers


def _compute_answer_probabilities(
    table: TomlTable, noise: float, feedback: Sequence[str], pomdp: Pomdp
) -> Array:
    """Return P(o | v) (V, O): the feedback of value v with probability 1 - noise, else another answer."""
    answers = list(dict.fromkeys(feedback))
    if noise and len(answers) < 2:
        raise DomainError(f"{table.location('noise')}: noise needs at least two different answers")
    probabilities = np.zeros((len(feedback), len(pomdp.observations)))
    for v, given in enumerate(feedback):
        for answer in answers:
            p = 1 - noise if answer == given else noise / (len(answers) - 1)
            probabilities[v, pomdp.observations.index(answer)] = p
    return probabilities


def _read_presence(table: TomlTable, program: Program, senses: Sequence[Sense]) -> Mapping[str, Presence]:
    """Read `present`: sense -> the people whom it perceives."""
    if not tuple(table):
        return {}
    from lcorpp.domains.sections.presence import read_presence  # few domains have the table

    return read_presence(table, program, senses)
