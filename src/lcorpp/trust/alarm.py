"""Alarm: a sequential test of knowledge, classifiers and observation model, with a bounded error rate."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict
from itertools import permutations
from typing import Any

import numpy as np

from lcorpp.errors import DecisionError
from lcorpp.notebook import html_table
from lcorpp.protocols import Dialogue
from lcorpp.trust.answers import NOISE_DEGREES, STATED_DEGREE, AnswerModel, Noise
from lcorpp.trust.finding import (
    BIAS_CHANGE,
    FORM_CHANGES,
    HEARING,
    KNOWLEDGE,
    Finding,
)
from lcorpp.trust.forms import AnswerForm, ByNumber, Repeated
from lcorpp.trust.hypotheses import Hypotheses
from lcorpp.values import Array, Label, Step

FALSE_ALARM_RATE = 0.05
"""Probability of a false alarm, ever, by default."""

ALTERNATIVE_DEGREES = slice(STATED_DEGREE % 5, len(NOISE_DEGREES), 5)
"""Every fifth of `NOISE_DEGREES`, the stated model among them: the noise of the alternatives."""

BIASES = 0.05, 0.1, 0.2, 0.3, 0.4, 0.5
"""Probabilities with which an observation replaces that of a noisy model: answers are biased towards it,
whatever the value."""

BIASED_PRIOR = FORM_PRIOR = UNEQUAL_PRIOR = 0.05
"""Prior probability that the program is right and answers are biased, of another form, or noisier to one
question than to others."""

UNEQUAL_DEGREES = (0.0, 0.25, 0.5, 0.75)
"""Degrees of noise of one question and of all others, if they differ."""

TIRING_NOISES = (0.0, 0.3, 0.6, 0.9), (0.0, 0.2, 0.4, 0.6), (0.2, 0.4, 0.6, 0.8), (0.4, 0.6, 0.8, 0.95)
"""Degrees of noise at the first, second, third and later answers of people who tire; reversed, of people who
get used to the robot."""

REPEATED_NOISES = tuple((first, again) for first in (0.0, 0.2, 0.4) for again in (0.5, 0.9))
"""Degrees of noise of new questions, and of repeated ones towards the answer of before."""

MIN_NAME_PROBABILITY, MAX_WAIT_FACTOR = 0.9, 30.0
"""An alarm waits until what it names has this probability, or E exceeds the threshold by this factor: the
name is then more often right."""

MIN_LIKELIHOOD = np.finfo(np.float64).tiny
"""Smallest likelihood of a person by a hypothesis that E is compared with; a larger one makes E smaller."""

MAX_LOG_DIFFERENCE = 1e-6
"""Hypotheses whose log likelihoods differ by less are equivalent."""


def check_rate(rate: float) -> None:
    """Raise `DecisionError` if a rate of false alarms is not between 0 and 1."""
    if not 0 < rate < 1:
        raise DecisionError(f"the rate of false alarms is {rate}; expected a number between 0 and 1")


_FORM_SIZES = len(TIRING_NOISES), len(TIRING_NOISES), len(REPEATED_NOISES)
"""The number of models of each of `FORM_CHANGES`."""


class Alarm:
    """Tests after each person whether program, classifiers and observation model (hearing) are as stated.

    The likelihood of hypothesis f and observation model d after some people is L(f, d); f = 0 is the stated
    program, and d = 0 the stated model; others are noisy, noisy and biased (`BIASES`), noisier to one
    question than to others, or depend on the person's earlier answers (`lcorpp.trust.forms`). With M the mean
    of L, weighted by prior probabilities, over all f and noisy d, and all other d with f = 0, there are two
    statistics

        E(knowledge) = M / max_d L(0, d)        E(hearing) = M / max_f L(f, 0)

    An alarm is raised when E reaches 1 / rate, or a little later, see `MIN_NAME_PROBABILITY`. If the program
    is right, whatever the model among these, the probability that E(knowledge) ever does is at most `rate`;
    likewise for the hearing, whatever the program among the hypotheses. If both are right, both E are at most
    M / L(0, 0), so the probability of any alarm is at most `rate`, too. An alarm about noise is followed by
    another one that names a form of answers, if that becomes as probable.

    Args:
        hypotheses: the stated program, and what may be wrong with it.
        dialogue: the planner's model as questions.
        rate: the largest probability of a false alarm, between 0 and 1.

    Attributes:
        n_people: number of people so far. findings: the alarms, at most one for each part, and one more that
            names the form of the answers.

    Raises:
        DecisionError: `rate` is not between 0 and 1.

    Source: Wasserman, Ramdas and Balakrishnan, "Universal inference", PNAS 117(29), 2020.

    Examples:
        >>> from lcorpp import Reasoner, Step, load_domain, parse_plog
        >>> from lcorpp.domains.dialogue import DomainDialogue
        >>> from lcorpp.trust import Alarm, Hypotheses
        >>> domain, rule = load_domain("intention"), "pr(intention=interested | identity=visitor) = "
        >>> other = parse_plog(str(domain.program).replace(rule + "4/5", rule + "1/5"))
        >>> hypotheses = Hypotheses(
        ...     [Reasoner(domain.program), Reasoner(other)], [[1, 0], [0, 1]],
        ...     ["", "intention"], ["", "inverted for visitors"], [0.5, 0.5], domain,
        ... )
        >>> alarm = Alarm(hypotheses, DomainDialogue(domain), rate=0.05)
        >>> facts = {"time": "afternoon", "location": "library"}  # of visitors, who are said to be interested
        >>> answer = Step("move_forward", "neg", domain.pomdp.start)
        >>> for _ in range(12):  # people who say no three times
        ...     findings = alarm.update(facts, 3 * [answer])
        >>> [(finding.person, finding.part, finding.change) for finding in alarm.findings]
        [(10, 'knowledge', 'inverted for visitors')]
    """

    def __init__(self, hypotheses: Hypotheses, dialogue: Dialogue, *, rate: float = FALSE_ALARM_RATE) -> None:
        check_rate(rate)
        self._hypotheses, self._dialogue = hypotheses, dialogue
        self._rate, self._threshold = rate, -np.log(rate)
        logs = _list_log_likelihoods(AnswerModel.of_tables(dialogue.tables))  # (N, D, V)
        self._answers = logs.transpose(1, 0, 2).copy()
        self._forms = _list_forms(dialogue.tables)
        n_models = len(logs) + sum(len(own) for _, own in self._forms)
        self._noise = NOISE_DEGREES[ALTERNATIVE_DEGREES]
        self._stated = int(np.flatnonzero(self._noise == 0)[0])
        # a hypothesis whose posterior underflows stays at 0, but E is beyond every threshold before
        self._posterior = np.outer(np.full(len(self._noise), 1 / len(self._noise)), hypotheses.priors)
        self._log_m = 0.0
        self._knowledge = np.zeros(n_models)  # log L(0, d)
        n_observations = int(np.count_nonzero(np.ptp(dialogue.tables, axis=(0, 1))))
        self._n_unformed, self._n_biased = len(logs), n_observations * len(BIASES) * len(self._noise)
        self._hearing = np.zeros(len(hypotheses.priors))  # log L(f, 0)
        self.n_people = 0
        self.findings = list[Finding]()

    def __repr__(self) -> str:
        values = ", ".join(f"E({part}) = {np.exp(value):.3g}" for part, value in self.log_e.items())
        return f"<Alarm at {1 / self._rate:g} after {self.n_people} people: {values}>"

    def _repr_html_(self) -> str:
        raised = {finding.part: finding for finding in self.findings}
        rows = []
        for part, value in self.log_e.items():
            finding = raised.get(part)
            where = "" if finding is None else ", ".join((*finding.attributes, finding.change)).strip(", ")
            person = "" if finding is None else str(finding.person)
            rows.append((part, f"{np.exp(value):.3g}", person, where))
        caption = f"Alarm after {self.n_people} people; raised at E = {1 / self._rate:g}"
        return html_table(("part", "E", "raised after people", "probably wrong"), rows, caption=caption)

    @property
    def log_e(self) -> Mapping[str, float]:
        """The logarithm of E of each part."""
        log_m = float(np.logaddexp.reduce(list(self._find_parts_of_m().values())))
        return {
            KNOWLEDGE: log_m - float(self._knowledge.max()),
            HEARING: log_m - float(self._hearing.max()),
        }

    def update(self, evidence: Mapping[str, Label], steps: Iterable[Step]) -> list[Finding]:
        """Update the statistics with a person; return the new alarms.

        Args:
            evidence: as for the reasoner. steps: of the decision.

        Raises:
            UndefinedError: the evidence is impossible under the stated program.
        """
        history = [(step.action, step.observation) for step in steps if step.observation is not None]
        joint = self._hypotheses.predict(evidence)  # (F, V)
        answers = list(self._dialogue.find_answers(history))
        logs = np.add.reduce(self._answers[np.array(answers, np.intp)])  # (N, V), 0 without answers
        shape = self._dialogue.tables.shape
        formed = [
            own[:, np.array(form.find_cells(answers, shape[0], shape[2]), np.intp)].sum(axis=1)
            for form, own in self._forms
        ]
        logs = np.concatenate([logs, *formed])
        top = logs.max()
        likelihoods = np.exp(logs - top)
        noisy = likelihoods[ALTERNATIVE_DEGREES]  # (noise, V)
        self._knowledge += np.log(np.maximum(likelihoods @ joint[0], MIN_LIKELIHOOD)) + top
        self._hearing += np.log(np.maximum(joint @ noisy[self._stated], MIN_LIKELIHOOD)) + top
        total = float(((self._posterior @ joint) * noisy).sum())
        self._posterior *= (noisy / total) @ joint.T
        self._log_m += float(np.log(total)) + float(top)
        self.n_people += 1
        return self._check()

    def replace_hypotheses(self, hypotheses: Hypotheses) -> bool:
        """Use other hypotheses from now on, e.g. after a training; return whether they have the same faults.

        The bound remains: E compares what each hypothesis predicted of each person before.
        """
        is_same = all(
            getattr(hypotheses, name) == getattr(self._hypotheses, name) for name in ("attributes", "changes")
        )
        if is_same:
            self._hypotheses = hypotheses
        return is_same

    def state(self) -> dict[str, Any]:
        """Return the state as JSON; numbers have all their digits."""
        return {
            "hypotheses": self._list_hypotheses(),
            "options": self._options(),
            "people": self.n_people,
            "findings": [
                asdict(finding) | {"attributes": list(finding.attributes)} for finding in self.findings
            ],
            "log_m": self._log_m,
            **{name: array.tolist() for name, array in self._arrays().items()},
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Continue exactly from the state of an alarm with the same arguments, before the first `update`.

        Raises:
            DecisionError: `update` has been called; or the state is damaged, or is that of an
                alarm with other arguments.
        """
        if self.n_people:
            raise DecisionError(f"the alarm already counts {self.n_people} people; expected a new one")
        try:
            if state["hypotheses"] != self._list_hypotheses():
                raise DecisionError("the state is of an alarm with other hypotheses; expected its own")
            if state["options"] != self._options():
                raise DecisionError(
                    f"the state is of an alarm with {state['options']}; expected {self._options()}"
                )
            for name, array in self._arrays().items():
                array[...] = np.array(state[name], np.float64).reshape(array.shape)
            self._log_m, self.n_people = float(state["log_m"]), int(state["people"])
            self.findings = [Finding(**f | {"attributes": tuple(f["attributes"])}) for f in state["findings"]]
            if not np.isclose(self._posterior.sum(), 1) or not np.isfinite([*self.log_e.values()]).all():
                raise ValueError("no probabilities of the hypotheses")
        except (LookupError, TypeError, ValueError) as error:
            raise DecisionError(
                f"the state of the alarm is damaged ({type(error).__name__}: {error})"
            ) from error

    def find_probabilities(self) -> dict[str, float]:
        """Return the probability of each attribute, given that one alone is wrong."""
        by_fault = self._posterior.sum(axis=0)[1:]
        totals = dict.fromkeys(self._hypotheses.attributes[1:], 0.0)
        for attribute, p in zip(self._hypotheses.attributes[1:], by_fault.tolist(), strict=True):
            totals[attribute] += p / float(by_fault.sum())
        return totals

    def _list_hypotheses(self) -> list[list[str]]:
        return [
            list(fault) for fault in zip(self._hypotheses.attributes, self._hypotheses.changes, strict=True)
        ]

    def _options(self) -> dict[str, Any]:
        return {"given": self._hypotheses.given, "rate": self._rate}

    def _arrays(self) -> dict[str, Array]:
        return {"posterior": self._posterior, "knowledge": self._knowledge, "hearing": self._hearing}

    def _check(self) -> list[Finding]:
        known = {(finding.part, self._is_form(finding)) for finding in self.findings}
        found, waits = list[Finding](), self._threshold + np.log(MAX_WAIT_FACTOR)
        for part, value in self.log_e.items():
            is_named = (part, part == HEARING) in known
            if value < self._threshold or is_named:
                continue
            own = self._describe(part, value)
            is_new = (part, self._is_form(own)) not in known
            is_late = value >= waits and (part, False) not in known
            if is_new and (own.probability >= MIN_NAME_PROBABILITY or is_late):
                found.append(own)
        self.findings += found
        return found

    @staticmethod
    def _is_form(finding: Finding) -> bool:
        return finding.part == HEARING and finding.change in FORM_CHANGES

    def _find_parts_of_m(self) -> dict[str, float]:
        """Return the logarithms of what noisy models, "", biased ones and forms contribute to M."""

        def average(logs: Array) -> float:
            return float(np.logaddexp.reduce(logs)) - float(np.log(len(logs)))

        begin = len(NOISE_DEGREES)
        end = begin + self._n_biased
        others = 1 - BIASED_PRIOR - FORM_PRIOR
        noisy = self._log_m
        if end < self._n_unformed:
            unequal = average(self._knowledge[end : self._n_unformed])
            noisy = np.logaddexp(
                np.log(1 - UNEQUAL_PRIOR / others) + noisy, np.log(UNEQUAL_PRIOR / others) + unequal
            )
        parts = {
            "": float(np.log(others) + noisy),
            BIAS_CHANGE: float(np.log(BIASED_PRIOR)) + average(self._knowledge[begin:end]),
        }
        begin, n_formed = self._n_unformed, len(self._knowledge) - self._n_unformed
        for change, size in zip(FORM_CHANGES, _FORM_SIZES, strict=True):
            share = np.log(FORM_PRIOR * size / n_formed)
            parts[change] = share + average(self._knowledge[begin : begin + size])
            begin += size
        return parts

    def _describe(self, part: str, log_e: float) -> Finding:
        noise = float(self._noise[self._posterior.sum(axis=1).argmax()])
        if part == HEARING:
            parts = self._find_parts_of_m()
            change = max(parts, key=lambda name: parts[name])
            share = np.exp(parts[change] - np.logaddexp.reduce(list(parts.values())))
            return Finding(self.n_people, part, log_e, (), change, noise, float(share))
        hypotheses, by_fault = self._hypotheses, self._posterior.sum(axis=0)
        by_attribute = self.find_probabilities()
        named = max(by_attribute, key=lambda name: by_attribute[name])
        own = [f for f, attribute in enumerate(hypotheses.attributes) if attribute == named]
        best = max(own, key=lambda f: by_fault[f])
        with np.errstate(divide="ignore"):
            logs = np.log(by_fault / hypotheses.priors)
        equal = np.flatnonzero(np.abs(logs - logs[best]) < MAX_LOG_DIFFERENCE)
        attributes = tuple(dict.fromkeys([named, *[hypotheses.attributes[f] for f in equal if f]]))
        probability = sum(by_attribute[name] for name in attributes)
        return Finding(self.n_people, part, log_e, attributes, hypotheses.changes[best], noise, probability)


def _list_log_likelihoods(model: AnswerModel) -> Array:
    """Return (N, D, V) the log likelihoods of answers by noisy models, then by biased and unequal ones."""
    biased = [
        model.find_log_likelihoods(_add_bias(model.add_noise(Noise((degree,))), observation, bias))
        for observation in np.flatnonzero(np.ptp(model.stated_rows, axis=0)).tolist()
        for bias in BIASES
        for degree in NOISE_DEGREES[ALTERNATIVE_DEGREES]
    ]
    unequal = [
        model.find_log_likelihoods(
            np.where(own[:, None], model.add_noise(Noise((degree,))), model.add_noise(Noise((other,))))
        )
        for own in model.list_questions()
        for degree, other in permutations(UNEQUAL_DEGREES, 2)
        if len(model.row_of) > 1
    ]
    return np.concatenate([model.noisy_log_likelihoods, biased, *([unequal] if unequal else [])])


def _list_forms(tables: Array) -> list[tuple[AnswerForm, Array]]:
    """Return forms of answers, with (A, D', V) the log likelihoods of answers by A models of each."""
    number, repeated = ByNumber(), Repeated(tables.shape[2])
    noises = [*TIRING_NOISES, *(own[::-1] for own in TIRING_NOISES)]
    return [
        (form, np.array([model.find_log_likelihoods(model.add_noise(Noise(tuple(own)))) for own in degrees]))
        for form, degrees in ((number, noises), (repeated, REPEATED_NOISES))
        for model in (form.make_answers(tables),)
    ]


def _add_bias(rows: Array, observation: int, bias: float) -> Array:
    """Return rows (R, O) in which an observation replaces others with a probability, where it is possible."""
    certain = np.eye(rows.shape[1])[observation]
    return np.where(rows[:, [observation]] > 0, (1 - bias) * rows + bias * certain, rows)
