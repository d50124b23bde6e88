"""The `[simulation]` section of a domain: who comes, how they move and how they answer."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from lcorpp.domains.domain import Simulation
from lcorpp.domains.plugin import SimulationPlugin
from lcorpp.domains.sections.planning import Planning, declared
from lcorpp.domains.sections.reasoning import Knowledge, Learning, attribute_values, require_same
from lcorpp.domains.toml import Settings
from lcorpp.errors import DomainError, expected_one_of
from lcorpp.reasoning import Program, Reasoner, read_plog
from lcorpp.values import Array


def read_simulation(
    section: Settings, folder: Path, knowledge: Knowledge, learning: Learning, planning: Planning
) -> Simulation:
    truth = read_plog(folder / section.text("truth")) if "truth" in section else knowledge.program
    for name in (knowledge.target, *knowledge.observed):
        values = attribute_values(section.place("truth"), name, truth)
        believed = knowledge.program.attributes[name]
        declared = f"the values of {name} at {knowledge.program.file}:{believed.line}"
        require_same(f"{truth.file}:{truth.attributes[name].line}", values, believed.values, declared)
    people = SimulationPlugin(folder / section.text("people")) if "people" in section else None
    simulation = Simulation(
        truth=truth,
        reactions=_reactions(section, knowledge, planning),
        channel=_channel(section, truth, knowledge, learning),
        trajectories=people.trajectories if people and people.has_motion else None,
        reaction=people.reaction if people and people.has_reaction else None,
        recordings=people.recordings if people and people.has_recordings else None,
        columns=people.columns if people else (),
    )
    section.close()
    return simulation


def _reactions(section: Settings, knowledge: Knowledge, planning: Planning) -> Array:
    """(A, S, O) how people answer: by the feedback and its noise, or as the planner's model says."""
    pomdp = planning.pomdp
    noise = section.number("noise", 0, 1, 0)
    if "feedback" not in section:
        if noise:
            raise DomainError(f"{section.place('noise')}: needs a feedback to disturb")
        return pomdp.observation.dense
    feedback = section.mapping("feedback")
    require_same(
        section.place("feedback"), tuple(feedback), knowledge.values, f"the values of {knowledge.target}"
    )
    for value, observation in feedback.items():
        if observation not in pomdp.observations:
            raise DomainError(
                f"{section.place('feedback', value)}: {declared(pomdp, 'observations')} has no observation"
                f" {observation!r}; {expected_one_of(pomdp.observations)}"
            )
    answers = list(dict.fromkeys(feedback.values()))
    if noise and len(answers) < 2:
        raise DomainError(
            f"{section.place('noise')}: with one answer only there is nothing to confuse it with"
        )
    heard = np.zeros((len(knowledge.values), len(pomdp.observations)))
    for v, value in enumerate(knowledge.values):
        for answer in answers:
            right = answer == feedback[value]
            share = 1 - noise if right else noise / (len(answers) - 1)
            heard[v, pomdp.observations.index(answer)] = share
    reactions = pomdp.observation.dense.copy()
    people = planning.share.any(axis=1)
    for a, action in enumerate(pomdp.actions):
        if action in planning.reports:
            continue
        reactions[a, people] = planning.share[people] @ heard
        impossible = (reactions[a, people].max(axis=0) > 0) & (
            pomdp.observation.dense[a, people].max(axis=0) == 0
        )
        if impossible.any():
            observation = pomdp.observations[int(np.argmax(impossible))]
            raise DomainError(
                f"{section.place('feedback')}: people may answer {observation!r} to {action!r}, which"
                f" {pomdp.file} calls impossible in every state"
            )
    return reactions


def _channel(
    section: Settings, truth: Program, knowledge: Knowledge, learning: Learning
) -> dict[str, dict[str, float]] | None:
    """P(label | target value) of the classifier as a channel: as given, else as the truth program says."""
    words = tuple(learning.label_of.values())
    if "channel" in section:
        table = section.section("channel")
        require_same(
            section.place("channel"),
            tuple(table),
            knowledge.values,
            f"the values of {knowledge.target}",
        )
        channel = {}
        for value in knowledge.values:
            row = table.section(value)
            require_same(table.place(value), tuple(row), words, f"the values of {learning.attribute}")
            channel[value] = {word: row.number(word, 0, 1) for word in words}
            row.close()
            total = sum(channel[value].values())
            if abs(total - 1) > 1e-9:
                raise DomainError(f"{table.place(value)}: the probabilities sum to {total:g}, not 1")
        table.close()
        return channel
    if learning.attribute not in truth.attributes:
        return None
    reasoner = Reasoner(truth)
    marginal = reasoner.posterior(knowledge.target, {})
    return {
        value: dict(reasoner.posterior(learning.attribute, {knowledge.target: value}))
        if marginal[value]
        else dict.fromkeys(words, 1 / len(words))  # never met, so never asked
        for value in knowledge.values
    }
