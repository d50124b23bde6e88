"""A new domain from six answers: its facts, shared variables, senses, questions and rewards."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction
from itertools import product
from math import isfinite, prod

from lcorpp.errors import DomainError, expected_one_of

MAX_VALUES = 100
"""Maximum number of combinations of shared values: the model has a state and a report for each."""

SENSE_RELIABILITY, QUESTION_COST, QUESTION_RELIABILITY = "0.8", "1", "0.85"
"""Numbers of senses and questions that are not given."""

TERMINAL = "done"
"""The state after a report."""

RESERVED = frozenset(
    ("random", "pr", "obs", "do", "not", "or", "and", "mod", "abs", "true", "false", "none", "boolean", "e")
)
"""Words with a meaning in P-log or in the model, which are not names."""


@dataclass(frozen=True)
class NewVariable:
    """An attribute of people.

    rates: (value, probability as text) of some values; the others share the rest.
    """

    name: str
    values: tuple[str, ...]
    rates: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True)
class NewSense:
    """A sense that classifies a variable; its class is right with probability `reliability`, a text."""

    name: str
    of: str
    reliability: str = SENSE_RELIABILITY

    def label(self, value: str) -> str:
        """Return the name of the label for a value."""
        return f"{self.name}_{value}"


@dataclass(frozen=True)
class NewQuestion:
    """A question about a shared variable; its answer is understood with probability `reliability`, a text."""

    name: str
    of: str
    cost: str = QUESTION_COST
    reliability: str = QUESTION_RELIABILITY


@dataclass(frozen=True)
class NewDomain:
    """The six answers.

    right, wrong: rewards of a report with all values right, and of any other one.

    Raises:
        DomainError: a name or number is wrong, a name is used twice, or there are too many values.
    """

    name: str
    facts: tuple[NewVariable, ...] = ()
    shared: tuple[NewVariable, ...] = ()
    senses: tuple[NewSense, ...] = ()
    questions: tuple[NewQuestion, ...] = ()
    right: float = 20.0
    wrong: float = -20.0

    def __post_init__(self) -> None:
        if not self.name.strip() or not self.name.isprintable():
            raise DomainError(f"the name {self.name!r} of the domain: expected printable text")
        for variable in self.variables:
            _check_variable(variable)
        attributes = [v.name for v in self.variables] + [sense.name for sense in self.senses]
        _check_distinct("attribute", attributes)
        of_senses = {variable.name: variable for variable in self.shared}
        for sense in self.senses:
            check_name("sense", sense.name)
            _check_of("sense", sense.name, sense.of, of_senses)
            _check_number(f"the reliability of the sense {sense.name!r}", sense.reliability, 0, 1)
        values = {value for variable in self.variables for value in variable.values}
        labels = [sense.label(v) for sense in self.senses for v in of_senses[sense.of].values]
        sorts = [f"{name}_values" for name in attributes]
        for name in [*values, *labels, *sorts]:
            if name in attributes or (name in sorts and name in values.union(labels)):
                raise DomainError(f"{name!r} is the name of an attribute and of a value; expected two names")
        if prod(len(variable.values) for variable in self.shared) > MAX_VALUES:
            raise DomainError(
                f"the shared variables have more than {MAX_VALUES} combinations of values; expected fewer"
            )
        states = ["_".join(combination) for combination in product(*[v.values for v in self.shared])]
        _check_distinct("state of the model", [*states, TERMINAL])
        for question in self.questions:
            check_name("question", question.name)
            _check_of("question", question.name, question.of, of_senses)
            _check_number(f"the cost of the question {question.name!r}", question.cost, 0, 1e6)
            _check_number(f"the reliability of the question {question.name!r}", question.reliability, 0, 1)
        _check_distinct("action", [q.name for q in self.questions] + [f"report_{state}" for state in states])
        if not (isfinite(self.right) and isfinite(self.wrong) and self.wrong < self.right):
            raise DomainError(f"the rewards {self.right:g} and {self.wrong:g}: expected right > wrong")

    @property
    def variables(self) -> tuple[NewVariable, ...]:
        """The facts and the shared variables."""
        return self.facts + self.shared


def parse_variable(text: str) -> NewVariable:
    """Return the variable in a text such as ``time=morning:0.3,noon:20%,evening``; rates are optional."""
    name, equals, values = text.partition("=")
    if not equals or not name.strip():
        raise DomainError(f"{text!r}: expected NAME=VALUE,VALUE,...")
    pairs = [part.strip().partition(":") for part in values.split(",")]
    rates = tuple([(value.strip(), _read_percent(rate)) for value, colon, rate in pairs if colon])
    return NewVariable(name.strip(), tuple([value.strip() for value, _, _ in pairs]), rates)


def parse_senses(text: str, shared: Sequence[NewVariable]) -> tuple[NewSense, ...]:
    """Return the sense in a text such as ``gaze:wish:0.8``: NAME[:VARIABLE][:RELIABILITY]."""
    name, of, numbers = _split(text, shared, ("RELIABILITY",))
    if len(of) > 1:
        raise DomainError(f"sense {text!r}: expected NAME:VARIABLE; {expected_one_of(of)}")
    return tuple([NewSense(name, variable, *numbers) for variable in of])


def parse_questions(text: str, shared: Sequence[NewVariable]) -> tuple[NewQuestion, ...]:
    """Return the questions of a text such as ``ask:item:1.5:0.8``: NAME[:VARIABLE][:COST[:RELIABILITY]].

    Without a variable there is a question for each, e.g. ``ask_item`` and ``ask_room``.
    """
    name, of, numbers = _split(text, shared, ("COST", "RELIABILITY"))
    names = [name] if len(of) == 1 else [f"{name}_{variable}" for variable in of]
    return tuple([NewQuestion(own, variable, *numbers) for own, variable in zip(names, of, strict=True)])


def _split(
    text: str, shared: Sequence[NewVariable], numbers: Sequence[str]
) -> tuple[str, list[str], list[str]]:
    """Return the name, the variable or all of them, and the numbers of a text with colons."""
    name, *rest = [_read_percent(part) for part in text.split(":")]
    of = [variable.name for variable in shared]
    if rest and not _is_number(rest[0]):
        of = [rest.pop(0)]
    if not name or len(rest) > len(numbers) or not all(map(_is_number, rest)):
        raise DomainError(f"{text!r}: expected NAME[:VARIABLE][:{'[:'.join(numbers)}{']' * len(numbers)}")
    return name, of, rest


def _read_percent(text: str) -> str:
    """Return the number of a text in percent, ``70%``, as a decimal fraction; another text as it is."""
    text = text.strip()
    number = text.removesuffix("%").strip()
    return format(Decimal(number) / 100, "f") if text.endswith("%") and _is_number(number) else text


def _is_number(text: str) -> bool:
    return re.fullmatch(r"[+-]?(\d+\.?\d*|\.\d+)", text) is not None


def _check_variable(variable: NewVariable) -> None:
    check_name("variable", variable.name)
    for value in variable.values:
        check_name(f"value of {variable.name}", value)
    _check_distinct(f"value of {variable.name}", variable.values)
    if len(variable.values) < 2:
        raise DomainError(f"{variable.name!r} has {len(variable.values)} value; expected two or more")
    for value, rate in variable.rates:
        _check_number(f"the probability of {variable.name}={value}", rate, 0, 1)
    total, complete = sum(Fraction(r) for _, r in variable.rates), len(variable.rates) == len(variable.values)
    if total > 1 or (complete and total != 1):
        raise DomainError(f"the probabilities of {variable.name} sum to {float(total):g}, not 1")


def check_name(what: str, name: str) -> None:
    """Check the name of a part of a domain.

    Raises:
        DomainError: P-log does not allow it, or it has a meaning there.
    """
    if name in RESERVED:
        raise DomainError(
            f"the {what} {name!r}: expected no word of P-log or of the model: {', '.join(sorted(RESERVED))}"
        )
    if not re.fullmatch(r"[a-z][a-z0-9_]*", name):
        raise DomainError(f"the {what} {name!r}: expected a lower-case letter, then letters, digits or _")


def _check_of(what: str, name: str, of: str, shared: Iterable[str]) -> None:
    if of not in shared:
        raise DomainError(f"the {what} {name!r} is about {of!r}; {expected_one_of(list(shared))}")


def _check_number(what: str, text: str, low: float, high: float) -> None:
    if not _is_number(text) or not low < float(text) <= high:
        raise DomainError(f"{what} is {text!r}; expected a number above {low:g}, at most {high:g}")


def _check_distinct(what: str, names: Sequence[str]) -> None:
    for name in names:
        if names.count(name) > 1:
            raise DomainError(f"{what} {name!r} appears twice; expected different names")
