"""The result of an audit as values: estimates of numbers and rates, tests of attributes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from lcorpp.notebook import html_table, join_some
from lcorpp.reasoning.language.syntax import Probability

MAX_P_VALUE = 0.05
"""Probability that a right rate is named as wrong, and that a rival of the chosen numbers is not listed."""

MAX_CHANGE_P_VALUE = 0.01
"""Probability that a right number is among those to change, in one step of their choice."""


@dataclass(frozen=True)
class ProbabilityEstimate:
    """An estimate of a stated probability.

    name: what it is of; a pr-atom without its number. stated: None if nothing is stated.
    interval: 95 %, None if the data do not determine it.
    p_value: of what is stated; 1 without an interval.
    """

    name: str
    stated: float | None
    estimate: float
    interval: tuple[float, float] | None
    p_value: float


@dataclass(frozen=True)
class NumberEstimate(ProbabilityEstimate):
    """An estimate of one number of the knowledge, if all others are as stated.

    statement: the pr-atom. gain: twice the gain in log likelihood. is_missing: whether the program has no
    such rule, and what is stated follows from the equal probability of all values.
    """

    statement: Probability
    gain: float
    is_missing: bool


@dataclass(frozen=True)
class RateEstimate(ProbabilityEstimate):
    """A probability of a sense's label or of an answer, given the shared value.

    is_sense: whether it is of a sense. rule: as a pr-atom without its number, "" if it is none.
    """

    is_sense: bool
    rule: str


@dataclass(frozen=True)
class AttributeTest:
    """The gain in likelihood if all numbers of an attribute are free.

    gain: twice the gain in log likelihood. bic: gain minus `n_numbers` times log n; positive values favour
    free numbers. p_value: of the stated numbers, all together.
    """

    name: str
    n_numbers: int
    gain: float
    bic: float
    p_value: float


@dataclass(frozen=True)
class WrongAnswers:
    """How often answers are wrong, in one part of them.

    part: for `number` how many questions were answered before, the last part with all later ones; for
    `repeated` 0 for new questions and 1 for the same question again, whose rate is that of other answers than
    before; for `class` the class of people. share: of the answers, for `class` of the people. rate: of wrong
    answers. interval: 95 %, None for classes.
    """

    part: int
    share: float
    rate: float
    interval: tuple[float, float] | None


@dataclass(frozen=True)
class FormTest:
    """A form of answers, against answers that are independent given the value.

    name: of the form. gain: twice the gain in log likelihood. degrees: number of further free probabilities.
    bic: gain minus `degrees` times log n. p_value: of independent answers. wrong: answers, by parts.
    """

    name: str
    gain: float
    degrees: int
    bic: float
    p_value: float
    wrong: tuple[WrongAnswers, ...]


def choose_form(tests: Sequence[FormTest]) -> FormTest | None:
    """Return the form by which the data refute independent answers; None if there is none.

    Its p-value is below `MAX_P_VALUE`, corrected for the number of tests (Bonferroni); of several it is the
    one of the largest BIC.
    """
    found = [test for test in tests if test.p_value * len(tests) < MAX_P_VALUE]
    return max(found, key=lambda test: test.bic, default=None)


@dataclass(frozen=True)
class Rival:
    """Other numbers whose change explains the data as well.

    names: one pr-atom without its number, or the attributes of which all numbers change.
    """

    names: tuple[str, ...]


@dataclass(frozen=True)
class Audit:
    """The result of `audit_people`.

    numbers: each alone, the others as stated. attributes: each with all its numbers free. rates: of senses
    and answers.
    changes: the fewest numbers that have to change together, with their joint estimates; () if nothing stated
    is refuted. rivals: changes that explain the data as well: one number, or all of one or two attributes.
    n_undetermined: number of combinations that the data do not determine if all numbers are free.
    undetermined: the rules in these combinations.
    excluded: facts -> number of people with them whom the stated numbers exclude: what is known of them has
    the probability 0.
    n_people, strategy, n_others, skipped: as of `LoggedPeople`. given: whether the facts are given.
    simulations: number of simulated logs from which the p-values of attributes come; 0 without.
    forms: tests of forms of answers; none if people of the log have given at most one answer.
    """

    program_file: str
    model_file: str
    n_people: int
    strategy: str
    n_others: int
    skipped: Mapping[str, int]
    given: bool
    numbers: Sequence[NumberEstimate]
    attributes: Sequence[AttributeTest]
    rates: Sequence[RateEstimate]
    changes: Sequence[NumberEstimate]
    rivals: Sequence[Rival]
    n_undetermined: int
    undetermined: Sequence[str]
    excluded: Mapping[str, int]
    simulations: int = 0
    forms: Sequence[FormTest] = ()

    def __repr__(self) -> str:
        changes = join_some([f"{x.name}: {x.stated:.3g} -> {x.estimate:.3f}" for x in self.changes])
        return (
            f"<Audit of {self.program_file}: {self.n_people} people, {len(self.numbers)} numbers,"
            f" {len(self.rates)} rates; to change: {changes or 'none'}>"
        )

    def _repr_html_(self) -> str:
        found = {id(x) for x in (*self.changes, *self.changed_rates)}
        changes = {x.name: x for x in self.changes}  # estimated together
        rows = []
        for x in (*(changes.get(x.name, x) for x in self.numbers), *self.rates):
            interval = (
                "not determined" if x.interval is None else f"{x.interval[0]:.3f} to {x.interval[1]:.3f}"
            )
            stated = "" if x.stated is None else f"{x.stated:.3g}"
            rows.append((x.name, stated, f"{x.estimate:.3f}", interval, "refuted" if id(x) in found else ""))
        name = Path(self.program_file).name
        caption = f"Audit of {name}: {self.n_people} people about whom {self.strategy} decided"
        return html_table(
            ("number", "stated", "suggested", "95 % interval", "by the data"), rows, caption=caption
        )

    @property
    def form(self) -> FormTest | None:
        """The form of answers by which the data refute independent ones; None if there is none."""
        return choose_form(self.forms)

    @property
    def changed_rates(self) -> list[RateEstimate]:
        """The rates that the data refute, corrected for their number (Bonferroni)."""
        limit = MAX_P_VALUE / max(len(self.rates), 1)
        return [rate for rate in self.rates if rate.p_value < limit]
