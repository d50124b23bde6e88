"""What is learnt from people under one form of answers: sources, their weights, and the observation model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from typing import Any

import numpy as np

from lcorpp.latent_classes import normalise
from lcorpp.protocols import Dialogue, DomainInterface, Memory, Planner, Starts
from lcorpp.trust.answers import AnswerModel
from lcorpp.trust.known_people import KnownPeople, PersonRecord, bound_belief
from lcorpp.trust.options import TrustOptions
from lcorpp.trust.planned_rows import find_planned_rows
from lcorpp.trust.sources.learnt import LearntSources
from lcorpp.trust.sources.stated import NO_EVIDENCE
from lcorpp.trust.sources.weights import SourceWeights
from lcorpp.values import Array, Label

FIRST_SEARCH, SEARCH_ITERATIONS = 25, 40
"""Number of people at the first search for alternative estimates, which is repeated when it has grown by a
quarter; and its iterations of EM."""


@dataclass(frozen=True)
class StatedForm:
    """A form of answers with the stated observation model.

    name: of the form. dialogue: the questions in the copies of the form. answers: their model. planner: for
    the stated model.
    """

    name: str
    dialogue: Dialogue
    answers: AnswerModel
    planner: Planner


@dataclass(frozen=True, eq=False)
class SameValue:
    """Prediction about a person with a record, if the value persists since the last meeting.

    belief: (W,) P(value | labels), with the person's class. memory: at the start of the conversation.
    labels_same, labels_new: P(labels) if the value persists, and if it is a new one.
    persistence: probability that a value persists, without the labels.
    """

    belief: Array
    memory: Memory | None
    labels_same: float
    labels_new: float
    persistence: float

    @property
    def p_same(self) -> float:
        """P(the value persists | labels)."""
        same = self.persistence * self.labels_same
        return same / (same + (1 - self.persistence) * self.labels_new)


@dataclass(frozen=True, eq=False)
class Prediction:
    """Prediction about a person before any answer.

    rows: (sources, W) P(value | labels), with the person's class, of each source. new: (W,) their mixture.
    n_classes: of people. same: prediction if the value persists; None for a person without a record.
    """

    rows: Array
    new: Array
    n_classes: int
    same: SameValue | None = None

    @property
    def starts(self) -> Starts:
        """Each possible memory at the start, with (W,) its probability with each value."""
        if self.same is None:
            return [(None, self.new)]
        p_same = self.same.p_same
        return [(None, (1 - p_same) * self.new), (self.same.memory, p_same * self.same.belief)]

    @property
    def mixture(self) -> Array:
        """(W,) P(value), with the person's class."""
        total: Array = reduce(np.add, (own for _, own in self.starts))
        return total

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
        stated_sources: names of those that do not learn.

    Attributes:
        sources: those that learn. source_weights: of all. people: records of those with an id.
        tables: the observation model of the last plan. planner: for the next one.
    """

    def __init__(
        self,
        domain: DomainInterface,
        form: StatedForm,
        stated_rates: Sequence[Array],
        stated_sources: Sequence[str],
        options: TrustOptions,
    ) -> None:
        self.dialogue, self.planner, self._options = form.dialogue, form.planner, options
        self.tables = form.dialogue.tables
        self._n_classes = form.answers.n_classes
        self.sources = LearntSources(domain, form.answers, stated_rates, options.memory)
        names = (*stated_sources, *self.sources.names)
        self.source_weights = SourceWeights(len(names), names.index(NO_EVIDENCE), form.answers, options.share)
        self.people = KnownPeople()
        self._next_fit, self._next_search, self._is_stale = 1, FIRST_SEARCH, False

    @property
    def weights(self) -> Array:
        """(sources,) summing to 1: those that do not learn, first the knowledge, then `sources.names`."""
        return self.source_weights.of_sources

    @property
    def is_as_stated(self) -> bool:
        """Whether the planner is for the stated observation model."""
        return np.array_equal(self.tables, self.dialogue.tables)

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
        record = self.people.find(person)
        if record is None:
            return Prediction(rows, self.weights @ rows, self._n_classes)
        if self._n_classes > 1:
            rows = normalise(rows * np.repeat(record.odds, rows.shape[1] // self._n_classes))
        new, model = self.weights @ rows, self.sources.learnt
        likelihood = model.compute_label_likelihood(labels)
        belief = record.belief * likelihood
        labels_same = float(belief.sum())
        labels_new = float(model.pi[context] @ likelihood)  # some sources leave out the labels
        persistence = self.people.persistence
        same = SameValue(belief / labels_same, record.memory, labels_same, labels_new, persistence)
        return Prediction(rows, new, self._n_classes, same)

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
        weights, log_answers = self.source_weights, self.sources.learnt.estimates.log_answers
        logs = weights.compute_log_likelihoods(answers, log_answers)
        top = float(logs.max())
        likelihoods, memory, p_answers_same = np.exp(logs - top), None, None
        p_answers = likelihoods @ predicted.rows.T
        joint = weights.compute_joint(predicted.rows, likelihoods)
        total = float(joint.sum())
        if (same := predicted.same) is not None:
            continued = self.dialogue.find_answers(history, same.memory)
            own = np.exp(weights.compute_log_likelihoods(continued, log_answers) - top)
            joint_same = same.belief * (weights.of_noises @ own)
            self.people.compare(same.labels_same * float(joint_same.sum()), same.labels_new * total)
            p_answers_same = same.p_same * (own @ same.belief)
            p_answers = (1 - same.p_same) * p_answers
            joint_same, joint = same.p_same * joint_same, (1 - same.p_same) * joint
            total = float(joint.sum() + joint_same.sum())
            p_same, joint = float(joint_same.sum()) / total, joint + joint_same
            if p_same >= 1 / 2 or not answers:
                answers, memory = continued, same.memory
        weights.update(p_answers, p_answers_same)
        self.sources.add(context, labels, answers)
        if person is not None:
            memory = self.dialogue.find_memory(history, memory)
            self._remember(person, predicted, joint / total, memory)
        return float(np.log(total)) + top

    def _remember(
        self,
        person: str,
        predicted: Prediction,
        belief: Array,
        memory: Memory | None,
    ) -> None:
        """Replace the record of a person by the belief (W,) and the memory after the answers."""
        before = self.people.find(person)
        n = self._n_classes
        gained = belief.reshape(n, -1).sum(axis=1) / predicted.mixture.reshape(n, -1).sum(axis=1)
        odds = normalise(gained * (1.0 if before is None else before.odds))
        self.people.add(person, PersonRecord(bound_belief(belief), memory, bound_belief(odds)))

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
            rows = find_planned_rows(learnt, self.source_weights, self._options.max_stated_loss)
            self.tables, self._is_stale = learnt.answers.make_tables(rows), False
        self.planner = self.dialogue.make_planner(self.tables, self.sources.learnt.class_shares)

    def replace_rates(self, stated_rates: Sequence[Array], *, refit: bool) -> None:
        """Use other stated rates, see `LearntSources.replace_rates`."""
        if self.sources.replace_rates(stated_rates) and refit:
            self.sources.fit(self._options.iterations)

    def state(self) -> dict[str, Any]:
        """Return what is learnt as JSON."""
        return {
            "source_weights": self.source_weights.state(),
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
        self.source_weights.restore(state["source_weights"])
        self.tables = np.array(state["tables"], np.float64).reshape(self.tables.shape)
        self._next_fit, self._next_search = state["next_fit"], state["next_search"]
        self._is_stale = state["stale"]
        if has_people:
            self.planner = self.dialogue.restore(state["planners"])
