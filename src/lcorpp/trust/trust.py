"""Trust: a mixture of sources of knowledge and an observation model, both learnt from people's answers."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from lcorpp.decision.strategies import NO_RATES, Rates
from lcorpp.errors import DecisionError
from lcorpp.notebook import html_table, join_some
from lcorpp.protocols import Dialogue, DomainInterface, Planner, Reasoner
from lcorpp.trust.answers import AnswerModel
from lcorpp.trust.asking import AskingPlanner
from lcorpp.trust.cases import NO_LABEL
from lcorpp.trust.latent_class_model import LatentClassModel
from lcorpp.trust.learnt_sources import LearntSources
from lcorpp.trust.optimism import find_optimistic_rows
from lcorpp.trust.options import DEFAULT_OPTIONS, TrustOptions
from lcorpp.trust.sources import StatedSources
from lcorpp.values import Array, Distribution, Label, Likelihood, Step

FIRST_SEARCH, SEARCH_ITERATIONS = 25, 40
"""Number of people at the first search for alternative estimates, which is repeated when it has grown by a
quarter; and its iterations of EM."""


class Trust:
    """A reasoner that learns the weights of its sources of knowledge from each decision.

        trust = Trust(reasoner, domain, dialogue, planner)
        robot = Robot(classifiers, trust, trust.make_planner(), domain)   # for each person
        trust.learn(episode.evidence, episode.steps)

    The prior of a person is the mixture of what the sources predict. A source's weight grows with the
    probability that it gave to the answers. The sources are those of `StatedSources`, and two latent class
    models that do not depend on the knowledge; see docs/guides/trust/sources.md.

    Args:
        reasoner: theta, the program with the stated rates of the classifiers.
        domain: names the values, labels and the shared attribute.
        dialogue: the planner's model as questions. planner: for that model.
        rates: attribute of a sense -> label -> (V,) P(label | value), for senses whose rates are not in the
            program (soft evidence); a likelihood counts as its most probable label in the learnt models.
        options: see `TrustOptions`.

    Attributes:
        sources: their names. weights: (sources,) summing to 1. n_people: number of people learnt from.
        tables: (K, V, O) P(answer | value) of K kinds of questions, the observation model for planning.
        planner: for the next person, by that model.

    Source of the mixture: Herbster and Warmuth, "Tracking the best expert", Machine Learning 32, 1998 (fixed
    share).

    Examples:
        >>> from lcorpp import Step, load_robot
        >>> from lcorpp.assembly.strategies.trust_setup import set_up_trust
        >>> robot = load_robot("intention", cache=False).robot
        >>> trust = set_up_trust(robot.domain, robot.reasoner, robot.planner)
        >>> facts = {"time": "afternoon", "location": "classroom"}
        >>> for _ in range(10):  # people who say no three times
        ...     trust.learn(facts, 3 * [Step("move_forward", "neg", robot.planner.start)])
        >>> before, after = robot.reasoner.posterior("intention", facts), trust.posterior("intention", facts)
        >>> round(before["interested"], 3), round(after["interested"], 3)
        (0.455, 0.025)
    """

    def __init__(
        self,
        reasoner: Reasoner,
        domain: DomainInterface,
        dialogue: Dialogue,
        planner: Planner,
        *,
        rates: Rates = NO_RATES,
        options: TrustOptions = DEFAULT_OPTIONS,
    ) -> None:
        self.options, self.planner = options, planner
        self._domain, self._dialogue, self._start = domain, dialogue, domain.marginal(planner.start)
        stated_rates = self._set_reasoner(reasoner, rates)
        self.tables = dialogue.tables
        self.answers = AnswerModel.of_tables(self.tables)
        self._learnt = LearntSources(domain, self.answers, stated_rates, options.memory)
        self.sources = (*self._stated.names, *self._learnt.names)
        self.weights = np.full(len(self.sources), 1 / len(self.sources))
        self.n_people, self._next_fit, self._next_search = 0, 1, FIRST_SEARCH
        self._n_repeated = 0  # people with `ask_answers` answers

    def __repr__(self) -> str:
        weights = zip(self.sources, self.weights.tolist(), strict=True)
        parts = join_some([f"{name} {weight:.2f}" for name, weight in weights])
        return f"<Trust after {self.n_people} people: {parts}>"

    def _repr_html_(self) -> str:
        weights = zip(self.sources, self.weights.tolist(), strict=True)
        rows = [(name, f"{weight:.3f}") for name, weight in weights]
        return html_table(("source", "weight"), rows, caption=f"Trust after {self.n_people} people")

    def posterior(self, attribute: str | Sequence[str], evidence: Mapping[str, Label]) -> Distribution:
        """Return the mixture of the sources' predictions (`lcorpp.protocols.Reasoner`).

        Raises:
            DecisionError: `attribute` is not what reasoner and planner share.
            UndefinedError: the evidence is impossible under the knowledge.
        """
        if attribute != self._domain.shared and tuple(attribute) != self._domain.shared:
            raise DecisionError(f"trust predicts {self._domain.shared!r}, not {attribute!r}")
        prior = self.weights @ self._predict(evidence, *self._index(evidence))
        return Distribution.unchecked(self._domain.values, prior)

    def make_planner(self) -> Planner:
        """Return the planner for the next person, which sometimes asks to learn."""
        options = self.options
        least = options.min_asked if self.learnt.alternative is None else options.max_asked
        asks = options.ask_every and (
            self.n_people % options.ask_every == 0 or self._n_repeated < least * self.n_people**0.5
        )
        wanted = options.ask_answers if asks else 0
        return AskingPlanner(self.planner, self._domain, self._dialogue, wanted)

    def learn(self, evidence: Mapping[str, Label], steps: Iterable[Step]) -> None:
        """Learn from a person: update the weights, then the models, then the planner.

        Args:
            evidence: what `posterior` got. steps: of the decision.
        """
        history = [(step.action, step.observation) for step in steps if step.observation is not None]
        answers = self._dialogue.find_answers(history)
        context, labels = self._index(evidence)
        likelihood = self.learnt.compute_likelihood(answers)
        weights = self.weights * (self._predict(evidence, context, labels) @ likelihood)
        share = self.options.share
        self.weights = (1 - share) * weights / weights.sum() + share / len(weights)
        self._learnt.add(context, labels, answers)
        self.n_people += 1
        self._n_repeated += len(answers) >= self.options.ask_answers
        if self.n_people >= self._next_fit:
            self._next_fit = self.n_people + max(1, self.n_people // self.options.refits)
            is_due = self.n_people >= self._next_search
            if is_due:
                self._next_search = self.n_people * 5 // 4
            self._learnt.fit(self.options.iterations, search=SEARCH_ITERATIONS if is_due else 0)
            self.tables = self.answers.make_tables(find_optimistic_rows(self.learnt, self.options.max_loss))
        self.planner = self._dialogue.make_planner(self.tables)

    def retrain(self, reasoner: Reasoner, *, rates: Rates = NO_RATES) -> None:
        """Use classifiers that were trained again.

        The weights, and the contexts and answers of all people remain. Earlier labels of a sense whose stated
        rates have changed are those of another classifier: the learnt models forget them, and their rates
        restart at the new ones.

        Args:
            reasoner, rates: as of `Trust`, for the same attributes and labels.
        """
        is_changed = self._learnt.replace_rates(self._set_reasoner(reasoner, rates))
        if is_changed and self.n_people:
            self._learnt.fit(self.options.iterations)

    def _set_reasoner(self, reasoner: Reasoner, rates: Rates) -> list[Array]:
        """Set the sources that do not learn; return the stated rates (V, L) of each sense."""
        self._stated = StatedSources(reasoner, self._domain, self._start)
        self._labels, stated_rates = list[Mapping[str, int]](), list[Array]()
        for attribute in self._stated.attributes:
            if attribute in rates:
                names, table = tuple(rates[attribute]), np.array(list(rates[attribute].values())).T
            else:
                names, table = self._stated.compute_rates(attribute)
            self._labels.append({name: i for i, name in enumerate(names)})
            stated_rates.append(table)
        return stated_rates

    def state(self) -> dict[str, Any]:
        """Return what it has learnt as JSON; numbers have all their digits."""
        return {
            "sources": list(self.sources),
            "weights": self.weights.tolist(),
            "people": self.n_people,
            "repeated": self._n_repeated,
            "next_fit": self._next_fit,
            "next_search": self._next_search,
            "tables": self.tables.tolist(),
            "learnt": self._learnt.state(),
            "planners": self._dialogue.state(),
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Continue exactly from a state of trust with the same arguments, before the first person.

        Raises:
            DecisionError: it has already made predictions, or the state is damaged or of other sources.
        """
        if self.n_people:
            raise DecisionError(f"trust has learnt from {self.n_people} people; expected a new one")
        try:
            if state["sources"] != list(self.sources):
                raise DecisionError(
                    f"the state of trust is of the sources {', '.join(state['sources'])}; expected"
                    f" {', '.join(self.sources)}"
                )
            self._learnt.restore(state["learnt"])
            self.weights = np.array(state["weights"], np.float64).reshape(self.weights.shape)
            self.tables = np.array(state["tables"], np.float64).reshape(self.tables.shape)
            self.n_people, self._n_repeated = state["people"], state["repeated"]
            self._next_fit, self._next_search = state["next_fit"], state["next_search"]
            if self.n_people:
                self.planner = self._dialogue.restore(state["planners"])
        except (LookupError, TypeError, ValueError, AttributeError) as error:
            raise DecisionError(f"the state of trust is damaged ({type(error).__name__}: {error})") from error

    @property
    def learnt(self) -> LatentClassModel:
        """The model of all people, with the estimated observation model and rates."""
        return self._learnt.learnt

    def _predict(self, evidence: Mapping[str, Label], context: int, labels: Sequence[int]) -> Array:
        """Return (K, V) P(value) of each source."""
        stated = self._stated.predict(evidence)
        expected = self._stated.predict(self._find_facts(evidence))[0]
        return np.concatenate([stated, self._learnt.predict(context, labels, stated[0], expected)])

    def _index(self, evidence: Mapping[str, Label]) -> tuple[int, list[int]]:
        """Return the index of the context, and of the label of each sense."""
        labels = []
        for attribute, places in zip(self._stated.attributes, self._labels, strict=True):
            label = evidence.get(attribute)
            if isinstance(label, Likelihood):
                label = label.most_likely()
            labels.append(NO_LABEL if label is None else places[label])
        return self._learnt.index_context(self._find_facts(evidence)), labels

    def _find_facts(self, evidence: Mapping[str, Label]) -> dict[str, Label]:
        attributes = self._stated.attributes
        return {name: value for name, value in evidence.items() if name not in attributes}
