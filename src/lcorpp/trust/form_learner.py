"""What is learnt from people under one form of answers: sources, their weights, and the observation model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lcorpp.latent_classes import normalise
from lcorpp.protocols import Dialogue, DomainInterface, Memory, Planner, Starts
from lcorpp.trust.answers import AnswerModel
from lcorpp.trust.known_people import Acquaintance, KnownPeople, bound_belief
from lcorpp.trust.learnt_sources import LearntSources
from lcorpp.trust.optimism import find_planned_rows
from lcorpp.trust.options import TrustOptions
from lcorpp.values import Array, Label

FIRST_SEARCH, SEARCH_ITERATIONS = 25, 40
"""Number of people at the first search for alternative estimates, which is repeated when it has grown by a
quarter; and its iterations of EM."""

KNOWLEDGE_SHARE = 0.5
"""Part of the fixed share for the knowledge: where no source predicts better, what is stated is used."""


@dataclass(frozen=True)
class StatedForm:
    """A form of answers with the stated observation model.

    name: of the form. dialogue: the questions in the copies of the form. answers: their model. planner: for
    the stated model. n_copies: of each kind of question.
    """

    name: str
    dialogue: Dialogue
    answers: AnswerModel
    planner: Planner
    n_copies: int = 1


@dataclass(frozen=True, eq=False)
class Prediction:
    """What is expected of a person before any answer.

    weights: (sources,) of the sources. rows: (sources, W) P(value), with the person's class, of each one.
    again: (W,) the same if the value is that of the last time; None for somebody who is new.
    kept: the probability that it is. memory: with which the conversation starts then.
    """

    weights: Array
    rows: Array
    n_classes: int
    again: Array | None = None
    kept: float = 0.0
    memory: Memory | None = None

    @property
    def starts(self) -> Starts:
        """Each memory with which the conversation may start, with (W,) its probability with each value."""
        new = (None, (1 - self.kept) * (self.weights @ self.rows))
        return [new] if self.again is None else [new, (self.memory, self.kept * self.again)]

    @property
    def mixture(self) -> Array:
        """(W,) P(value), with the person's class."""
        new: Array = self.weights @ self.rows
        return new if self.again is None else (1 - self.kept) * new + self.kept * self.again

    @property
    def marginal(self) -> Array:
        """(V,) P(value)."""
        if self.n_classes == 1:
            return self.mixture
        values: Array = self.mixture.reshape(self.n_classes, -1).sum(axis=0)
        return values


class FormLearner:
    """The mixture of sources, and the observation model, if answers have one form.

    Args:
        n_stated: number of sources that do not learn.

    Attributes:
        weights: (sources,) summing to 1: those that do not learn, first the knowledge, then `learnt.names`.
        sources: those that learn. people: those who were met with an id.
        tables: the observation model of the last plan. planner: for the next one.
    """

    def __init__(
        self,
        domain: DomainInterface,
        form: StatedForm,
        stated_rates: Sequence[Array],
        n_stated: int,
        options: TrustOptions,
    ) -> None:
        self.dialogue, self.planner, self._options = form.dialogue, form.planner, options
        self.tables = form.dialogue.tables
        self._n_classes = form.answers.n_classes
        self._max_loss = options.max_loss / form.n_copies  # all copies of a question together
        self.sources = LearntSources(domain, form.answers, stated_rates, options.memory)
        n_sources = n_stated + len(self.sources.names)
        self._shares = np.full(n_sources, (1 - KNOWLEDGE_SHARE) / (n_sources - 1))
        self._shares[0] = KNOWLEDGE_SHARE
        self.weights = np.full(n_sources, 1 / n_sources)
        self.people = KnownPeople()
        self._next_fit, self._next_search, self._is_stale = 1, FIRST_SEARCH, False

    def index_context(self, facts: Mapping[str, Label]) -> int:
        """Return the index of a context; a new one is added."""
        return self.sources.index_context(facts)

    def predict(
        self,
        context: int,
        labels: Sequence[int],
        stated: Array,
        expected: Array,
        person: str | None = None,
    ) -> Prediction:
        """Predict a person's value by each source.

        Args:
            stated: (n, V) of those that do not learn. expected: (V,) by the knowledge, given the facts.
            person: id, if there is one.
        """
        if self._n_classes > 1:
            shares = self.sources.learnt.class_shares[:, None]
            stated = (shares * stated[:, None]).reshape(len(stated), -1)
            expected = (shares * expected).ravel()
        learnt = self.sources.predict(context, labels, stated[0], expected)
        rows = np.concatenate([stated, learnt])
        known = self.people.find(person)
        if known is None:
            return Prediction(self.weights, rows, self._n_classes)
        if self._n_classes > 1:
            rows = normalise(rows * np.repeat(known.odds, rows.shape[1] // self._n_classes))
        again = self.sources.learnt.weigh_labels(known.belief, labels)
        return Prediction(self.weights, rows, self._n_classes, again, self.people.kept, known.memory)

    def learn(
        self,
        context: int,
        labels: Sequence[int],
        predicted: Prediction,
        history: Sequence[tuple[str, str]],
        person: str | None = None,
    ) -> float:
        """Learn from a person, without fitting the models anew.

        Args:
            predicted: of `predict`, for the same person.

        Returns:
            log P(answers | facts, labels), by what was learnt before.
        """
        answers = self.dialogue.find_answers(history)
        logs = self._sum_logs(answers)
        top = float(logs.max())
        weights = self.weights * (predicted.rows @ np.exp(logs - top))
        total, kept = float(weights.sum()), 0.0
        joint = self.weights @ predicted.rows * np.exp(logs - top)
        if predicted.again is not None:
            continued = self.dialogue.find_answers(history, predicted.memory)
            again = predicted.again * np.exp(self._sum_logs(continued) - top)
            self.people.compare(float(again.sum()), total)
            new, again = (1 - predicted.kept) * total, predicted.kept * again
            total = new + float(again.sum())
            kept = 1 - new / total
            weights = (1 - kept) * weights / weights.sum() + kept * self.weights
            joint = (1 - predicted.kept) * joint + again
            if kept > 1 / 2:
                answers = continued
        share = self._options.share
        self.weights = (1 - share) * weights / weights.sum() + share * self._shares
        self.sources.add(context, labels, answers)
        if person is not None:
            self._remember(person, predicted, joint / total, kept, history)
        return float(np.log(total)) + top

    def _sum_logs(self, answers: Sequence[int]) -> Array:
        """Return (W,) log P(answers | value)."""
        total: Array = self.sources.learnt.estimates.log_answers[list(answers)].sum(axis=0)
        return total

    def _remember(
        self,
        person: str,
        predicted: Prediction,
        belief: Array,
        kept: float,
        history: Sequence[tuple[str, str]],
    ) -> None:
        """Replace what is known of a person by the belief (W,) after the answers."""
        before = self.people.find(person)
        n = self._n_classes
        gained = belief.reshape(n, -1).sum(axis=1) / predicted.mixture.reshape(n, -1).sum(axis=1)
        odds = normalise(gained * (1.0 if before is None else before.odds))
        memory = self.dialogue.find_memory(history, predicted.memory if kept > 1 / 2 else None)
        now = Acquaintance(bound_belief(belief), memory, odds)
        self.people.add(person, now)

    def fit(self, n_people: int) -> None:
        """Fit the models anew where it is due after this number of people."""
        if n_people < self._next_fit:
            return
        self._next_fit = n_people + max(1, n_people // self._options.refits)
        is_due = n_people >= self._next_search
        if is_due:
            self._next_search = n_people * 5 // 4
        self.sources.fit(self._options.iterations, search=SEARCH_ITERATIONS if is_due else 0)
        self._is_stale = True

    def plan(self) -> None:
        """Make the planner for the next person."""
        if self._is_stale:
            learnt = self.sources.learnt
            rows = find_planned_rows(learnt, self._max_loss, self._options.max_stated_loss)
            self.tables, self._is_stale = learnt.answers.make_tables(rows), False
        self.planner = self.dialogue.make_planner(self.tables, self.sources.learnt.class_shares)

    def replace_rates(self, stated_rates: Sequence[Array], *, refit: bool) -> None:
        """Use other stated rates, see `LearntSources.replace_rates`."""
        if self.sources.replace_rates(stated_rates) and refit:
            self.sources.fit(self._options.iterations)

    def state(self) -> dict[str, Any]:
        """Return what is learnt as JSON."""
        return {
            "weights": self.weights.tolist(),
            "next_fit": self._next_fit,
            "next_search": self._next_search,
            "stale": self._is_stale,
            "tables": self.tables.tolist(),
            "learnt": self.sources.state(),
            "people": self.people.state(),
            "planners": self.dialogue.state(),
        }

    def restore(self, state: Mapping[str, Any], *, has_people: bool) -> None:
        """Continue from a state, before the first person."""
        self.sources.restore(state["learnt"])
        self.people.restore(state["people"])
        self.weights = np.array(state["weights"], np.float64).reshape(self.weights.shape)
        self.tables = np.array(state["tables"], np.float64).reshape(self.tables.shape)
        self._next_fit, self._next_search = state["next_fit"], state["next_search"]
        self._is_stale = state["stale"]
        if has_people:
            self.planner = self.dialogue.restore(state["planners"])
