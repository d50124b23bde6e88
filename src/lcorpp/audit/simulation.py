"""People of a log simulated again, as if knowledge and rates were right."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from lcorpp.assembly.logged_parts import read_parts
from lcorpp.assembly.strategies.baselines import find_strategies
from lcorpp.audit.answer_rates import AnswerRates
from lcorpp.audit.logged_people import AnsweredPerson, LoggedPeople
from lcorpp.decision import Robot, Strategy
from lcorpp.decision.dt_control import act_until_report, infer_prior
from lcorpp.errors import DataError
from lcorpp.planning.policy_cache import find_cache_folder
from lcorpp.reasoning import Reasoner
from lcorpp.simulation import SimulationModel
from lcorpp.trust.cases import NO_LABEL, Cases
from lcorpp.values import Array, Belief, Indices

NumberKey = tuple[tuple[int, ...], int]
"""The statements whose numbers are fitted together, and one of them."""


@dataclass(frozen=True, eq=False)
class SimulatedFits:
    """What the audit of a simulated log finds.

    gains: of each attribute, and of the first choice. errors: of the log odds of fitted numbers, in standard
    errors.
    """

    gains: Mapping[str, float]
    errors: Mapping[NumberKey, float]


@dataclass(frozen=True, eq=False)
class SimulatedLogs:
    """Logs of as many people, drawn from the stated knowledge.

    Facts and shared values come from the program, labels and answers from rates, and the robot decides as in
    the log. A fact or label that a logged person lacks is missing in the simulated logs, too.

    people: of the log. given: whether people keep their facts.
    rates: estimated from them, with the knowledge as stated (`AnswerRates.with_contexts`): the most probable
        ones under the hypothesis that is tested. Those estimated without the knowledge, with few people in
        each context, are too good, and the simulated gains too small.

    Source: Davison and Hinkley, "Bootstrap Methods and their Application", 1997, section 4.2.

    Raises:
        DataError: the strategy learns from people or draws its actions, or a sense gives likelihoods.
        LcorppError: the strategy of the log cannot be set up again.
    """

    people: LoggedPeople
    rates: AnswerRates
    given: bool

    def __post_init__(self) -> None:
        name = self.people.strategy
        if self._strategy.start is not None or self._strategy.draws:
            kind = "learns from people" if self._strategy.start is not None else "draws its actions"
            raise DataError(f"{name} {kind}, so its decisions cannot be simulated again")
        if any(rates is None for rates in self.people.stated_rates):
            raise DataError("a sense gives likelihoods, so its labels cannot be simulated again")

    @cached_property
    def _strategy(self) -> Strategy:
        senses = [sense.name for sense in self.people.domain.senses]
        (found,) = find_strategies([self.people.strategy], senses)
        return found

    @cached_property
    def _robot(self) -> Robot:
        """The robot of the log, with the policy that it has now."""
        parts = read_parts(self.people.parts, self.people.domain, cache=find_cache_folder())
        return self._strategy.robot(parts.robot)

    @cached_property
    def _model(self) -> SimulationModel:
        """People who answer at the estimated rates."""
        domain, n_senses = self.people.domain, len(self.people.labels)
        tables = np.array(
            [
                self.rates.find_table(n_senses + k, len(domain.pomdp.observations))
                for k in range(len(self.people.dialogue.questions))
            ]
        )
        observation = self.people.dialogue.make_model(tables).observation.dense
        simulation = replace(domain.simulation, feedback_model=observation, world=None)
        return SimulationModel(replace(domain, simulation=simulation))

    @cached_property
    def _label_rates(self) -> list[Array]:
        """(V, L) P(label | value) of each sense."""
        return [self.rates.find_table(s, len(own)) for s, own in enumerate(self.people.labels)]

    def draw(self, seed: int) -> LoggedPeople:
        """Draw one log."""
        people, rng = self.people, np.random.default_rng([seed, 4])
        domain, cases, weights = people.domain, people.cases, people.cases.weights
        logged = np.repeat(np.arange(cases.n), np.round(weights).astype(np.intp))
        drawn = Cases(len(people.labels), cases.answer_counts.shape[1])
        answered = list[AnsweredPerson]()
        contexts, priors = dict[frozenset[tuple[str, str]], int](), dict[object, Belief]()
        for case, person in zip(logged.tolist(), self._sample(logged, rng), strict=True):
            names = people.contexts[cases.contexts[case]]
            facts = {name: person[name] for name in names}
            value = domain.values.index(domain.reasoning.join(person))
            labels = [
                NO_LABEL
                if cases.labels[case, s] == NO_LABEL
                else int(rng.choice(len(own[value]), p=own[value]))
                for s, own in enumerate(self._label_rates)
            ]
            key = frozenset(facts.items())
            prior = priors.get((key, *labels))
            if prior is None:
                prior = priors[key, *labels] = self._find_prior(facts, labels)
            world = self._model.make_world(person, rng)
            steps, _, _ = act_until_report(self._robot, prior, world)
            history = [(step.action, step.observation) for step in steps if step.observation is not None]
            answers = people.dialogue.find_answers(history)
            answered.append((contexts.setdefault(key, len(contexts)), labels, answers))
            drawn.add(*answered[-1])
        known = [dict(context) for context in contexts]
        return replace(people, contexts=known, cases=drawn, answered=answered)

    def _sample(self, logged: Indices, rng: np.random.Generator) -> list[Mapping[str, str]]:
        """Draw a person for each logged one (n,), by the index of its case."""
        people, reasoner = self.people, Reasoner(self.people.program)
        if not self.given:
            return list(reasoner.sample_many(len(logged), rng, {}))
        contexts = [people.contexts[people.cases.contexts[case]] for case in logged]
        return [reasoner.sample_many(1, rng, facts)[0] for facts in contexts]

    def _find_prior(self, facts: Mapping[str, str], labels: list[int]) -> Belief:
        """Return the belief before the first action."""
        predicted = {
            sense.name: sense.find_class(self.people.labels[s][labels[s]])
            for s, sense in enumerate(self.people.domain.senses)
            if labels[s] != NO_LABEL and self._strategy.uses(sense.name)
        }
        return infer_prior(self._robot, facts, predicted)[2]
