"""Trust: a mixture of sources of knowledge and an observation model, both learnt from people's answers."""

from __future__ import annotations

import reprlib
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from lcorpp.decision.strategies import NO_RATES, Rates
from lcorpp.errors import DecisionError
from lcorpp.notebook import html_table, join_some
from lcorpp.protocols import Dialogue, DomainInterface, Planner, Reasoner, Starts
from lcorpp.trust.answers import AnswerModel
from lcorpp.trust.asking import AskingPlanner, AskingRule
from lcorpp.trust.cases import NO_LABEL
from lcorpp.trust.form_learner import FormLearner, Prediction, StatedForm
from lcorpp.trust.latent_class_model import LatentClassModel
from lcorpp.trust.options import DEFAULT_OPTIONS, TrustOptions
from lcorpp.trust.sources.stated import StatedSources
from lcorpp.values import Array, Distribution, Label, Likelihood, Step

FORMS_PRIOR = 0.5
"""Weight of all forms of answers but the first one, before the first person."""

FORM_SHARE = 0.001
"""Probability that answers get another form between two people."""

STATE_VERSION = 3
"""Of `Trust.state`."""

MIN_INDEPENDENT = 0.2
"""The robot plans by independent answers while their weight is at least this: a form with more parameters may
fit as well by chance, and explain a classifier that lies as people who answer at random."""

MIN_WEIGHT = 0.1
"""A form with less weight is left out of predictions, and has no search for its policy."""


class Trust:
    """A reasoner that learns the weights of its sources of knowledge from each decision.

        trust = Trust(reasoner, domain, dialogue, planner)
        robot = Robot(classifiers, trust, trust.make_planner(), domain)   # for each person
        trust.learn(episode.evidence, episode.steps)

    The prior of a person is the mixture of what the sources predict. The weight of a source, together with
    a noise of the answers, grows with the probability that both gave to the answers. The sources are those of
    `StatedSources` and of `LearntSources`; see docs/guides/trust/sources.md.

    All this is learnt under each form of answers. A form gains weight by the probability that it gave to the
    answers. The prior is the mixture of what the forms predict. The robot plans by independent answers while
    they have some weight, then by the form of the largest one.

    Args:
        reasoner: theta, the program with the stated rates of the classifiers.
        domain: names the values, labels and the shared attribute.
        dialogue: the planner's model as questions. planner: for that model.
        forms: further forms of answers, beside independent ones.
        rates: attribute of a sense -> label -> (V,) P(label | value), for senses whose rates are not in the
            program (soft evidence); a likelihood counts as its most probable label in the learnt models.
        options: see `TrustOptions`.

    Attributes:
        domain: as given. sources: their names. weights: (sources,) summing to 1.
        n_people: number of people learnt from. asking: who is asked to learn, and what that has cost.
        tables: (K, V, O) P(answer | value) of K kinds of questions, the observation model for planning.
        planner: for the next person, by that model. These are of the form in use.
        forms: their names. form_weights: (forms,) summing to 1.

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
        (0.455, 0.03)
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
        forms: Sequence[StatedForm] = (),
    ) -> None:
        self.options = options
        self.domain, self._dialogue, self._start = domain, dialogue, domain.marginal(planner.start)
        stated_rates = self._set_reasoner(reasoner, rates)
        answers = AnswerModel.of_tables(dialogue.tables)
        independent = StatedForm("independent", dialogue, answers, planner)
        stated_forms = (independent, *forms)
        self.forms = tuple(form.name for form in stated_forms)
        self._learners = [
            FormLearner(domain, form, stated_rates, self._stated.names, options) for form in stated_forms
        ]
        self.sources = (*self._stated.names, *self._learners[0].sources.names)
        self.form_weights = self._form_prior
        self.asking = AskingRule(options, dialogue.question_cost)
        self._used = 0

    def __repr__(self) -> str:
        weights = zip(self.sources, self.weights.tolist(), strict=True)
        parts = join_some([f"{name} {weight:.2f}" for name, weight in weights])
        form = f"; answers: {self.form}" if len(self.forms) > 1 else ""
        return f"<Trust after {self.n_people} people: {parts}{form}>"

    def _repr_html_(self) -> str:
        weights = zip(self.sources, self.weights.tolist(), strict=True)
        rows = [(name, f"{weight:.3f}") for name, weight in weights]
        form = f", whose answers are {self.form}" if len(self.forms) > 1 else ""
        return html_table(("source", "weight"), rows, caption=f"Trust after {self.n_people} people{form}")

    def recognise(self, person: str) -> RecognisedPerson:
        """Return the reasoner for a person with an id.

        Args:
            person: id, as of `learn`.
        """
        _check_id(person)
        return RecognisedPerson(self, person)

    def posterior(self, attribute: str | Sequence[str], evidence: Mapping[str, Label]) -> Distribution:
        """Return the mixture of the predictions of sources and forms (`lcorpp.protocols.Reasoner`).

        Raises:
            DecisionError: `attribute` is not what reasoner and planner share.
            UndefinedError: the evidence is impossible under the knowledge.
        """
        return Distribution.unchecked(self.domain.values, self.predict(attribute, evidence, self.used)[0])

    def predict(
        self,
        attribute: str | Sequence[str],
        evidence: Mapping[str, Label],
        learner: FormLearner,
        person: str | None = None,
    ) -> tuple[Array, Prediction]:
        """Return what is expected of a person; other arguments and errors as of `posterior`.

        Args:
            learner: of one form.

        Returns:
            (V,) P(value), the mixture of the forms; and the prediction under the one form.
        """
        if attribute != self.domain.shared and tuple(attribute) != self.domain.shared:
            raise DecisionError(f"trust predicts {self.domain.shared!r}, not {attribute!r}")
        all_weights = self.form_weights.tolist()
        mixed = [k for k, own in enumerate(self._learners) if own is learner or all_weights[k] >= MIN_WEIGHT]
        learners, weights = [self._learners[k] for k in mixed], self.form_weights[mixed]
        predicted = self._predict(evidence, self._find_labels(evidence), learners, person)
        mixture: Array = weights @ np.array([own.marginal for own in predicted]) / weights.sum()
        return mixture, predicted[learners.index(learner)]

    def make_planner(self, planner: Planner | None = None) -> Planner:
        """Return the planner for the next person, which sometimes asks to learn.

        Args:
            planner: that it follows otherwise; by default that of the form in use.
        """
        planner = self.planner if planner is None else planner
        return AskingPlanner(planner, self.domain, self._dialogue, self._find_wanted())

    def learn(self, evidence: Mapping[str, Label], steps: Iterable[Step], person: str | None = None) -> None:
        """Learn from a person: update the weights, then the models, then the planner.

        Args:
            evidence: what `posterior` got. steps: of the decision.
            person: permanent id of the person; None without.
        """
        if person is not None:
            _check_id(person)
        history = [(step.action, step.observation) for step in steps if step.observation is not None]
        facts, labels = self._find_facts(evidence), self._find_labels(evidence)
        logs = [
            learner.learn(learner.index_context(facts), labels, predicted, history, person)
            for learner, predicted in zip(
                self._learners, self._predict(evidence, labels, self._learners, person), strict=True
            )
        ]
        weights = self.form_weights * np.exp(np.array(logs) - max(logs))
        self.form_weights = (1 - FORM_SHARE) * weights / weights.sum() + FORM_SHARE * self._form_prior
        n_questions = [action for action, _ in history].count(self._dialogue.question or "")
        self.asking.add(len(self._dialogue.find_answers(history)), n_questions, self._find_wanted())
        self._used = self._choose_form()
        for learner, weight in zip(self._learners, self.form_weights.tolist(), strict=True):
            learner.fit(self.n_people)
            if weight >= MIN_WEIGHT:
                learner.plan()

    def retrain(self, reasoner: Reasoner, *, rates: Rates = NO_RATES) -> None:
        """Use classifiers that were trained again.

        The weights, and the contexts and answers of all people remain. Earlier labels of a sense whose stated
        rates have changed are those of another classifier: the learnt models forget them, and their rates
        restart at the new ones.

        Args:
            reasoner, rates: as of `Trust`, for the same attributes and labels.
        """
        stated_rates = self._set_reasoner(reasoner, rates)
        for learner in self._learners:
            learner.replace_rates(stated_rates, refit=self.n_people > 0)

    def _set_reasoner(self, reasoner: Reasoner, rates: Rates) -> list[Array]:
        """Set the sources that do not learn; return the stated rates (V, L) of each sense."""
        self._stated = StatedSources(reasoner, self.domain, self._start)
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
            "version": STATE_VERSION,
            **self._describe_model(),
            **self.asking.state(),
            "form_weights": self.form_weights.tolist(),
            "learners": [learner.state() for learner in self._learners],
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Continue exactly from a state of trust with the same arguments, before the first person.

        Raises:
            DecisionError: it has already made predictions, or the state is damaged, of another version, or of
                other sources, values, labels, forms of answers or stated answers.
        """
        if self.n_people:
            raise DecisionError(f"trust has learnt from {self.n_people} people; expected a new one")
        try:
            if (version := state.get("version")) != STATE_VERSION:
                raise DecisionError(
                    f"the state of trust has the version {version!r}; this lcorpp reads {STATE_VERSION}"
                )
            for key, expected in self._describe_model().items():
                if (found := state.get(key)) != expected:
                    raise DecisionError(
                        f"the state of trust has other {key.replace('_', ' ')}, {reprlib.repr(found)};"
                        f" expected {reprlib.repr(expected)}"
                    )
            self.asking.restore(state)
            self.form_weights = np.array(state["form_weights"], np.float64).reshape(self.form_weights.shape)
            self._used = self._choose_form()
            for learner, own in zip(self._learners, state["learners"], strict=True):
                learner.restore(own, has_people=self.n_people > 0)
        except (LookupError, ArithmeticError, TypeError, ValueError, AttributeError) as error:
            raise DecisionError(f"the state of trust is damaged ({type(error).__name__}: {error})") from error

    def _describe_model(self) -> dict[str, Any]:
        """Return as JSON what a state and the trust that continues from it have in common."""
        values = [list(value) if isinstance(value, tuple) else value for value in self.domain.values]
        return {
            "sources": list(self.sources),
            "values": values,
            "labels": [list(names) for names in self._labels],
            "stated_answers": self._dialogue.tables.tolist(),
            "forms_of_answers": list(self.forms),
        }

    @property
    def n_people(self) -> int:
        return self.asking.n_people

    @property
    def used(self) -> FormLearner:
        """What is learnt under the form in use."""
        return self._learners[self._used]

    @property
    def form(self) -> str:
        """The name of the form in use."""
        return self.forms[self._used]

    @property
    def weights(self) -> Array:
        return self.used.weights

    @property
    def tables(self) -> Array:
        return self.used.tables

    @property
    def planner(self) -> Planner:
        return self.used.planner

    @property
    def learnt(self) -> LatentClassModel:
        """The model of all people, with the estimated observation model and rates."""
        return self.used.sources.learnt

    def _choose_form(self) -> int:
        return 0 if self.form_weights[0] >= MIN_INDEPENDENT else int(self.form_weights.argmax())

    def _find_wanted(self) -> int:
        return self.asking.find_wanted(
            has_alternative=self.learnt.alternative is not None, is_as_stated=self.used.is_as_stated
        )

    @property
    def _form_prior(self) -> Array:
        n_others = len(self.forms) - 1
        others = FORMS_PRIOR if n_others else 0.0
        return np.array([1 - others, *[others / max(n_others, 1)] * n_others])

    def _predict(
        self,
        evidence: Mapping[str, Label],
        labels: Sequence[int],
        learners: Sequence[FormLearner],
        person: str | None,
    ) -> list[Prediction]:
        """Return what is expected of a person by each of some forms."""
        stated, facts = self._stated.predict(evidence), self._find_facts(evidence)
        expected = stated[self._stated.facts_row]
        return [own.predict(own.index_context(facts), labels, stated, expected, person) for own in learners]

    def _find_labels(self, evidence: Mapping[str, Label]) -> list[int]:
        """Return the index of the label of each sense."""
        labels = []
        for attribute, places in zip(self._stated.attributes, self._labels, strict=True):
            label = evidence.get(attribute)
            if isinstance(label, Likelihood):
                label = label.most_likely()
            labels.append(NO_LABEL if label is None else places[label])
        return labels

    def _find_facts(self, evidence: Mapping[str, Label]) -> dict[str, Label]:
        attributes = self._stated.attributes
        return {name: value for name, value in evidence.items() if name not in attributes}


class RecognisedPerson:
    """The reasoner for one person whom the robot recognises, e.g. by the face (`lcorpp.protocols.Reasoner`).

        person = trust.recognise("face 17")
        robot = Robot(classifiers, person, person.make_planner(), domain)
        trust.learn(episode.evidence, episode.steps, "face 17")

    Args:
        person: id.
    """

    def __init__(self, trust: Trust, person: str) -> None:
        self._trust, self._person, self._learner = trust, person, trust.used  # of this moment
        self._predicted: Prediction | None = None

    def posterior(self, attribute: str | Sequence[str], evidence: Mapping[str, Label]) -> Distribution:
        """Return the mixture of what the sources predict and, if the person is known, what remains."""
        marginal, self._predicted = self._trust.predict(attribute, evidence, self._learner, self._person)
        return Distribution.unchecked(self._trust.domain.values, marginal)

    def make_planner(self) -> Planner:
        """Return the planner for the person; `posterior` is called before its first action."""
        learner = self._learner
        return self._trust.make_planner(learner.dialogue.start_known(learner.planner, self._find_starts))

    def _find_starts(self) -> Starts:
        if self._predicted is None:
            raise DecisionError("nothing is predicted of this person; expected a call of `posterior` first")
        return self._predicted.starts


def _check_id(person: object) -> None:
    if not isinstance(person, str):
        raise DecisionError(f"the id of a person is {reprlib.repr(person)}; expected a string")
