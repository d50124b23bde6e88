"""A model from a log of decisions: states, rewards and questions are those of its domain, numbers are learnt.

How people answer is estimated with free probabilities of the shared values for each combination of facts and
labels (a context): how much the robot asks depends on these, too. The answers of each person are then
evidence for the knowledge.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from lcorpp.domains import Domain
from lcorpp.errors import DataError, ModelError, expected_one_of
from lcorpp.latent_classes import normalise
from lcorpp.logs.decision_log import DAMAGE, LoggedDecision, describe_damage
from lcorpp.logs.strategy_decisions import read_decisions
from lcorpp.model_learning.baum_welch import PRIOR_STEPS, Parameters, expect
from lcorpp.model_learning.draws import resample_models
from lcorpp.model_learning.episode_records import compute_posteriors, make_records
from lcorpp.model_learning.episodes import Episodes
from lcorpp.model_learning.knowledge.knowledge import check_attributes, learn_knowledge
from lcorpp.model_learning.learnt_model import LearntModel, StatedDomain, name_states
from lcorpp.model_learning.spaces import Space, list_rights
from lcorpp.model_learning.structure import MOVES, STAYS, Model, Structure, fit, list_cells
from lcorpp.values import Array, Indices

TOLERANCE = 1e-8
"""The estimation ends when the log likelihood increases by less than this share: its maximum is flat."""

CONTEXT_PEOPLE = 1.0
"""Weight of the prior of P(context | shared value): for each context as many people, divided as stated."""

MIN_STATED = 0.01
"""Share of equal probabilities of the shared values in those that are stated, which may be wrong."""


def learn_from_log(
    path: str | Path,
    *,
    folder: Path | None = None,
    strategy: str | None = None,
    hidden: Mapping[str, Sequence[str]] | None = None,
    order: Sequence[str] = (),
    draws: int = 100,
    seed: int = 0,
    progress: Callable[[float], None] = lambda _share: None,
) -> LearntModel:
    """Learn the numbers of a domain and the structure of its knowledge from a log of decisions.

    True values are not read. The stated numbers are the start of the search; each row of observations counts
    as two steps, each row of transitions as half a step, and what is impossible remains so. Labels of all
    classifiers in the log have common rates.

    Args:
        path: of the log. folder: of the domain, if it is not the one of the log.
        strategy: whose decisions are read; None: the one with the most, see `read_decisions`.
        hidden, order: of `learn_knowledge`.
        draws, seed: of `learn_model`. progress: takes the completed share of the work.

    Raises:
        FileError: the log cannot be read.
        DataError: it has no decision that can be read, or hidden attributes or the order do not fit.
        ModelError: `draws` is less than 1.
        LcorppError: the domain cannot be loaded, or has no tables.

    Examples:
        >>> from pathlib import Path
        >>> from lcorpp import load_domain
        >>> from lcorpp.decision import strategies
        >>> from lcorpp.experiments import ComparisonOptions, compare_strategies
        >>> from lcorpp.model_learning import learn_from_log
        >>> options = ComparisonOptions(strategies(["LCORPP"]), trials=200, log=Path("people.jsonl"))
        >>> comparison = compare_strategies(load_domain("intention"), options)
        >>> learnt = learn_from_log(Path("people.jsonl"))
        >>> learnt.states[:2], sorted(learnt.knowledge.structure)
        (('interested_1', 'interested_2'), ['classifier', 'intention', 'location', 'time'])
    """
    if draws < 1:
        raise ModelError(f"draws is {draws}; expected at least 1")
    found = read_decisions(Path(path), strategy)
    domain, program = found.load(folder, "learning from a log")
    space, states = _read_space(domain), _order_states(domain)
    stated = _read_parameters(domain, states)
    structure = _find_structure(stated, domain.planning.state_values[states].argmax(axis=1))
    of_transition, of_observation, _ = PRIOR_STEPS
    pseudo = replace(
        stated,
        transition=of_transition * stated.transition,
        observation=of_observation * stated.observation,
    )
    skipped = found.skipped
    people = _drop_impossible(domain, _read_people(domain, found.decisions, skipped), stated, skipped)
    answered = [bool(steps) for _, steps in people]
    if not any(answered):
        reason = f": {next(iter(skipped))}" if skipped and not people else ""
        raise DataError(
            f"{path}: no decision has an answer{reason}; expected some, as nothing else relates people to"
            f" {' and '.join(space.variables)}"
        )
    facts = [own for own, _ in people]
    names = (*space.variables, *domain.observed, *domain.label_attributes)
    known = {name for own in facts for name in own} | set(space.variables)
    values = {name: domain.program.attributes[name].values for name in names if name in known}
    check_attributes(values, hidden, order)
    posteriors = compute_posteriors(program, facts, space)
    contexts = _Contexts.of(facts, (1 - MIN_STATED) * posteriors + MIN_STATED / len(space))
    episodes = contexts.make_episodes(domain, people)
    begin, pseudo = (contexts.extend(own, structure.values) for own in (stated, pseudo))
    begin = replace(begin, observation=normalise(begin.observation))
    model = fit(episodes, begin, contexts.extend_structure(structure), pseudo, tolerance=TOLERANCE)
    drawn = resample_models(episodes, model, pseudo, draws, np.random.default_rng(seed))
    restricted = tuple(contexts.restrict(own) for own in (model.parameters, *drawn))
    model = Model(restricted[0], structure, model.log_likelihood)
    progress(0.5)
    episodes = _make_episodes(domain, [own for own in people if own[1]])
    answers = iter(make_records(episodes, space, model))
    records = [
        next(answers) if is_answered else own for own, is_answered in zip(facts, answered, strict=True)
    ]
    knowledge = learn_knowledge(
        records,
        hidden=hidden,
        order=order,
        values=values,
        seed=seed,
        progress=lambda share: progress(0.5 + 0.5 * share),
    )
    return LearntModel(
        episodes,
        space,
        model,
        name_states(space, structure),
        domain.pomdp.discount,
        restricted[1:],
        knowledge,
        StatedDomain(
            domain.name, domain.pomdp.reward[:, states], domain.senses, found.strategy, dict(skipped)
        ),
    )


_Person = tuple[dict[str, str], list[tuple[int, int]]]
"""The facts and labels of a decision, and the indices of actions and answers."""


def _read_space(domain: Domain) -> Space:
    values = tuple((own,) if isinstance(own, str) else own for own in domain.values)
    reports = np.full((len(domain.pomdp.actions), len(values)), -1)
    for action, value in domain.planning.reports.items():
        reported = (value,) if isinstance(value, str) else value
        reports[domain.pomdp.actions.index(action)] = list_rights(reported, values)
    return Space("", domain.reasoning.shared, values, reports)


def _order_states(domain: Domain) -> list[int]:
    """Return the states by their shared values, of each value those first in which a decision may start."""
    initial, values = domain.planning.initial_states, domain.planning.state_values
    return [
        int(s)
        for v in range(values.shape[1])
        for s in sorted(np.flatnonzero(values[:, v]), key=lambda s: -initial[v, s])
    ]


def _read_parameters(domain: Domain, states: list[int]) -> Parameters:
    """Return the stated tables; rewards are no evidence."""
    pomdp, ends = domain.pomdp, list(domain.planning.terminal)
    transition = pomdp.transition.dense[:, states]
    over = transition[:, :, ends].sum(axis=2, keepdims=True)
    observation = pomdp.observation.dense
    return Parameters(
        domain.planning.initial_states[:, states].mean(axis=0),
        np.concatenate([transition[:, :, states], over], axis=2),
        np.concatenate([observation[:, states], observation[:, ends[:1] or states[:1]]], axis=1),
        np.ones((len(pomdp.actions), len(states), 1)),
    )


def _find_structure(stated: Parameters, values: Indices) -> Structure:
    """Return the structure of the stated numbers: states of an action with equal rows share one."""
    A, K = stated.reward.shape[:2]
    effects = np.full(A, MOVES)
    for action in range(A):
        if np.array_equal(stated.transition[action, :, :K], np.eye(K)):
            effects[action] = STAYS
    groups = np.zeros((A, K), dtype=np.intp)
    for action in range(A):
        _, places = np.unique(stated.observation[action, :K].round(12), axis=0, return_inverse=True)
        groups[action] = action * K + places.reshape(-1)
    cells = list_cells(groups, stated.observation.shape[2])
    return Structure(values, effects, groups, np.arange(A * K).reshape(A, K), cells)


def _read_people(domain: Domain, decisions: Sequence[LoggedDecision], skipped: Counter[str]) -> list[_Person]:
    """Return what is known of each person; why decisions cannot be read is added to `skipped`."""
    actions, observations = domain.pomdp.actions, domain.pomdp.observations
    people = list[_Person]()
    for line in decisions:
        try:
            content = line.content
            own = {name: str(value) for name, value in content["facts"].items() if name in domain.observed}
            for attribute in domain.label_attributes:
                label = content["evidence"].get(attribute)
                if isinstance(label, str):
                    own[attribute] = label
            for name, value in own.items():
                if value not in (known := domain.program.attributes[name].values):
                    raise DataError(f"{name} is {value}; {expected_one_of(known)}")
            steps = [
                (actions.index(step["action"]), observations.index(step["observation"]))
                for step in content["steps"]
                if step["observation"] is not None
            ]
            people.append((own, steps))
        except DAMAGE as error:
            skipped[describe_damage(error)] += 1
    return people


def _drop_impossible(
    domain: Domain, people: Sequence[_Person], stated: Parameters, skipped: Counter[str]
) -> list[_Person]:
    """Return the people whose answers the domain does not exclude."""
    answered = [own for own in people if own[1]]
    if not answered:
        return list(people)
    logs = iter(expect(_make_episodes(domain, answered), stated).log_likelihoods.tolist())
    kept = [own for own in people if not own[1] or np.isfinite(next(logs))]
    if len(kept) < len(people):
        skipped["the domain excludes its answers"] += len(people) - len(kept)
    return kept


def _make_episodes(domain: Domain, people: Sequence[_Person]) -> Episodes:
    """Return the answers of people as episodes that end before the report."""
    steps = np.array([step for _, own in people for step in own])
    return Episodes(
        domain.pomdp.actions,
        domain.pomdp.observations,
        np.zeros(1),
        np.ascontiguousarray(steps[:, 0]),
        np.ascontiguousarray(steps[:, 1]),
        np.zeros(len(steps), dtype=np.intp),
        np.cumsum([0, *(len(own) for _, own in people)]),
        np.zeros(len(people), dtype=np.bool_),
        tuple(facts for facts, _ in people),
    )


@dataclass(frozen=True, eq=False)
class _Contexts:
    """The combinations of facts and labels as observations of a first action, which changes nothing.

    places: (n,) the context of each person. stated: (X, V) the stated probabilities of the shared values.
    """

    places: Indices
    stated: Array

    @classmethod
    def of(cls, facts: Sequence[Mapping[str, str]], stated: Array) -> _Contexts:
        _, first, places = np.unique(
            [str(sorted(own.items())) for own in facts], return_index=True, return_inverse=True
        )
        return cls(places, stated[first])

    def make_episodes(self, domain: Domain, people: Sequence[_Person]) -> Episodes:
        """Return the episodes of all people, with their contexts."""
        action, first = len(domain.pomdp.actions), len(domain.pomdp.observations)
        own = [
            (facts, [(action, first + int(place)), *steps])
            for place, (facts, steps) in zip(self.places, people, strict=True)
        ]
        return _make_episodes(domain, own)

    def extend(self, parameters: Parameters, values: Indices) -> Parameters:
        """Return tables, or pseudo-counts, with the further action and its observations.

        A row of contexts has `CONTEXT_PEOPLE` in each, divided among the values as stated.
        """
        A, K, X = len(parameters.transition), parameters.count, len(self.stated)
        padded = np.concatenate([parameters.observation, np.zeros((A, K + 1, X))], axis=2)
        rows = np.zeros((1, K + 1, padded.shape[2]))
        rows[0, :K, -X:] = CONTEXT_PEOPLE * self.stated.T[values]
        rows[0, K, -X:] = 1 / X
        return Parameters(
            parameters.start,
            np.concatenate([parameters.transition, np.eye(K, K + 1)[None]]),
            np.concatenate([padded, rows]),
            np.ones((A + 1, K, 1)),
        )

    def extend_structure(self, structure: Structure) -> Structure:
        """Return the structure with the further action: states of a value have the same contexts."""
        A, K = structure.observation.shape
        observation = np.vstack([structure.observation, A * K + structure.values])
        return Structure(
            structure.values,
            np.append(structure.effects, STAYS),
            observation,
            np.arange((A + 1) * K).reshape(A + 1, K),
            list_cells(observation, structure.cells.shape[2] + len(self.stated)),
        )

    def restrict(self, parameters: Parameters) -> Parameters:
        """Return the tables without contexts."""
        return Parameters(
            parameters.start,
            parameters.transition[:-1],
            parameters.observation[:-1, :, : -len(self.stated)],
            parameters.reward[:-1],
        )
