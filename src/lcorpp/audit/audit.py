"""Audit: what the people of a log suggest for each number that was stated."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import combinations
from math import inf, log

import numpy as np
from scipy.special import logit
from scipy.stats import chi2

from lcorpp.audit.answer_forms import list_form_tests
from lcorpp.audit.answer_rates import AnswerRates
from lcorpp.audit.estimates import (
    MAX_CHANGE_P_VALUE,
    MAX_P_VALUE,
    AttributeTest,
    Audit,
    NumberEstimate,
    Rival,
)
from lcorpp.audit.intervals import (
    bound_stated,
    compare_log_odds,
    find_limits,
    find_spread,
    match_chi_squared,
)
from lcorpp.audit.knowledge import KnowledgeFits, find_ratio_weights
from lcorpp.audit.logged_people import LoggedPeople
from lcorpp.audit.missing_rules import add_missing_rules
from lcorpp.audit.rates import list_rates
from lcorpp.audit.simulation import NumberKey, SimulatedFits, SimulatedLogs
from lcorpp.errors import DataError, ProgramError
from lcorpp.fitting.number_model import list_free_numbers
from lcorpp.fitting.uncertainty import NULL_SCORE, Z95
from lcorpp.reasoning.language.syntax import Probability, Selection
from lcorpp.reasoning.resolve import resolve_evidence
from lcorpp.trust.answers import AnswerModel
from lcorpp.values import Array

MAX_PRIOR_SHARE = 0.5
"""A number is not determined if its variance is more than this share of the variance of its weak prior."""

MIN_SIMULATIONS = 99
"""Minimum number of simulated logs: with fewer no p-value reaches `MAX_CHANGE_P_VALUE`."""

FIRST_CHOICE = ""
"""Among the gains of attributes, the largest BIC by which the choice of numbers begins."""

N_STARTS = 5
"""Number of searches if all numbers of an attribute are free, as the likelihood may have several maxima."""

Progress = Callable[[int, int], None]


def audit_people(
    people: LoggedPeople,
    progress: Progress = lambda done, total: None,
    *,
    given: bool = False,
    simulations: int = 0,
    seed: int = 0,
    simulated: Progress = lambda done, total: None,
) -> Audit:
    """Audit the knowledge, the senses and the observation model.

    First, the rates of senses and answers are estimated without the knowledge; they give the likelihood of
    each person's shared value. Then each number is fitted alone, and each attribute with all its numbers.
    From these the fewest numbers are chosen whose change explains the data (BIC): an attribute or a number
    at a time, and of an attribute the numbers that are needed. Attributes without rules are
    audited as if equal probabilities were stated, see `add_missing_rules`. If the stated numbers exclude
    people of the log, those that are 0 are taken as a little more, see `EXCLUDED_SHARE`.

    Args:
        people: of `read_people`.
        progress: is called with the number of fits done, and the number of all.
        given: whether the facts are given, e.g. by the robot's own schedule, so that the likelihood
            conditions on them.
        simulations: the number of logs that are simulated under the stated knowledge, see `SimulatedLogs`;
            0, or at least `MIN_SIMULATIONS`. The p-values of attributes are then the shares of these logs
            with at least the same gain, and numbers are only changed if the first gain in their choice is
            larger than in 99 % of them. The intervals of numbers are those of the bootstrap t method, from
            as many logs simulated under the changed knowledge.
        seed: of the simulations. simulated: as `progress`, of the simulated logs.

    Raises:
        DataError: `simulations` is too small, or the decisions cannot be simulated again.
        ProgramError: the program has no numbers to audit, or they cannot be fitted.
        UndefinedError: what is known of a person is impossible under the program, whatever its numbers.
        TooLargeError: the program is too large to be compiled, or there are too many contexts.

    Examples:
        >>> from pathlib import Path
        >>> from lcorpp import load_domain
        >>> from lcorpp.audit import audit_people, read_people
        >>> from lcorpp.decision import strategies
        >>> from lcorpp.experiments import ComparisonOptions, compare_strategies
        >>> domain = load_domain("intention", changes={"simulation": {"noise": 0.4}})  # above the model's
        >>> options = ComparisonOptions(strategies(["LCORPP"]), trials=100, log=Path("audited.jsonl"))
        >>> comparison = compare_strategies(domain, options)
        >>> audit = audit_people(read_people(Path("audited.jsonl")))
        >>> len(audit.changes)  # the knowledge is not refuted, but how people answer:
        0
        >>> sorted({rate.name.partition(":")[0] for rate in audit.changed_rates})
        ['greet', 'move_forward']
    """
    if simulations and simulations < MIN_SIMULATIONS:
        raise DataError(f"{simulations} simulations; expected 0, or at least {MIN_SIMULATIONS}")
    auditor = _Auditor(people, progress, given)
    if not simulations:
        return auditor.audit()
    stated = auditor.simulate(simulations, seed, simulated)
    chosen = auditor.choose(stated)
    changed = auditor.simulate(simulations, seed + simulations, simulated, chosen) if chosen else stated
    return auditor.audit(stated, changed)


class _Auditor:
    def __init__(self, people: LoggedPeople, progress: Progress, given: bool) -> None:
        cases, domain = people.cases, people.domain
        used = [*domain.observed, *domain.reasoning.shared]
        program = add_missing_rules(people.program, used, domain.label_attributes)
        self._people, self._program, self._progress, self._given = people, program, progress, given
        self._n_people = float(cases.weights.sum())
        senses = set(domain.label_attributes)
        free = list_free_numbers(program, (), with_certain=True)
        ranges = {s.term.name for s in program.statements if isinstance(s, Selection) and s.range}
        free = {
            i: x
            for i, x in free.items()
            if (name := self._atom(i).term.name) not in senses and (0 < x < 1 or name not in ranges)
        }
        if not free:
            raise ProgramError(f"{program.file}: no number of a pr-atom to audit, apart from those of senses")
        answers = AnswerModel.of_tables(people.dialogue.tables)
        tables = [
            _guess_rates(people, place) if rates is None else rates
            for place, rates in enumerate(people.stated_rates)
        ]
        self._rates = AnswerRates(answers, tables, cases, len(people.contexts))
        self._stated_rates = tables
        values = [domain.reasoning.split(value) for value in domain.values]
        records = [
            resolve_evidence(program, {**facts, **value}) for facts in people.contexts for value in values
        ]
        parts = cases.contexts[:, None] * len(values) + np.arange(len(values))
        self._fits = KnowledgeFits(program, free, records, parts, self._rates, given=given)
        self._groups: dict[str, tuple[int, ...]] = {}
        for i in free:
            name = self._atom(i).term.name
            self._groups[name] = (*self._groups.get(name, ()), i)
        self._stated = self._fits.compute_stated()

    def fit_all(self) -> None:
        """Fit each number alone, and all numbers of each attribute."""
        free = list(self._fits.free)
        n_fits = len(free) + len(self._groups)
        for done, key in enumerate([*[(i,) for i in free], *self._groups.values()]):
            self._progress(done, n_fits)
            self._fits.fit(self._complete(key), N_STARTS if len(key) > 1 else 1)
        self._progress(n_fits, n_fits)

    def measure_gains(self) -> dict[str, float]:
        """Return the gain of each attribute, and the `FIRST_CHOICE`."""
        gains = {name: self._find_gain(own) for name, own in self._groups.items()}
        return {**gains, FIRST_CHOICE: max(map(self._find_bic, self._list_candidates()))}

    def simulate(
        self, count: int, seed: int, progress: Progress, chosen: tuple[int, ...] = ()
    ) -> list[SimulatedFits]:
        """Audit logs that are simulated under the stated knowledge, or with the chosen numbers changed."""
        changed = self._fits.fit(chosen) if chosen else None
        program = self._people.program if changed is None else self._fits.write_program(changed)
        rates = self._rates.with_contexts(self._fits.compute_contexts(changed))
        logs = SimulatedLogs(replace(self._people, program=program), rates, self._given)
        truth = {key: self._find_log_odds(*key, is_stated=not chosen)[0] for key in self._list_keys(chosen)}
        found = list[SimulatedFits]()
        for number in range(count):
            progress(number, count)
            drawn = replace(logs.draw(seed + number), program=self._people.program)
            other = _Auditor(drawn, lambda done, total: None, self._given)
            other.fit_all()
            estimates = {key: other._find_log_odds(*key) for key in truth}
            errors = {key: (estimates[key][0] - truth[key]) / estimates[key][1] for key in truth}
            found.append(SimulatedFits(other.measure_gains(), errors))
        progress(count, count)
        return found

    def choose(self, simulated: Sequence[SimulatedFits] = ()) -> tuple[int, ...]:
        """Return the statements of the fewest numbers to change; simulated: under what is stated."""
        self.fit_all()
        p_value = self._compare_with_simulated(simulated).get(FIRST_CHOICE, 0.0)
        may_change = bool(self._fits.excluding) or p_value <= MAX_CHANGE_P_VALUE
        return self._choose() if may_change else ()

    def audit(self, stated: Sequence[SimulatedFits] = (), changed: Sequence[SimulatedFits] = ()) -> Audit:
        """Return the audit; stated, changed: of `simulate` with no numbers changed, and with those chosen."""
        people, free = self._people, list(self._fits.free)
        chosen = self.choose(stated)
        p_values = self._compare_with_simulated(stated)
        n_undetermined, undetermined = self._fits.find_undetermined(NULL_SCORE)
        has_repeated = any(len(answers) > 1 for _, _, answers in people.answered)
        return Audit(
            program_file=people.program.file,
            model_file=people.domain.pomdp.file or str(people.domain.folder),
            n_people=round(self._n_people),
            strategy=people.strategy,
            n_others=people.n_others,
            skipped=people.skipped,
            given=self._given,
            numbers=[self._describe(self._complete((i,)), i, changed) for i in free],
            attributes=[self._describe_attribute(name, p_values) for name in self._groups],
            rates=list_rates(people, self._rates, MAX_PRIOR_SHARE),
            changes=[self._describe(chosen, i, changed) for i in chosen],
            rivals=self._list_rivals(chosen) if chosen else [],
            n_undetermined=n_undetermined,
            undetermined=[self._atom(i).left_side for i in undetermined],
            excluded=self._count_excluded(),
            simulations=len(stated),
            forms=list_form_tests(people, self._stated_rates) if has_repeated else (),
        )

    def _list_keys(self, chosen: tuple[int, ...]) -> list[NumberKey]:
        """List each number alone, and each of the chosen ones together."""
        alone = [(self._complete((i,)), i) for i in self._fits.free]
        return list(dict.fromkeys([*alone, *((chosen, i) for i in chosen)]))

    def _find_log_odds(
        self, statements: tuple[int, ...], statement: int, *, is_stated: bool = False
    ) -> tuple[float, float]:
        """Return the log odds of a number in a fit, or as stated, and their standard error."""
        fit = self._fits.fit(statements)
        place = fit.statements.index(statement)
        estimate = float(fit.estimates[place])
        number = float(bound_stated(fit.stated[place])) if is_stated else estimate
        return float(logit(number)), find_spread(estimate, float(fit.covariance[place, place]))

    def _compare_with_simulated(self, simulated: Sequence[SimulatedFits]) -> dict[str, float]:
        """Return the p-value of each gain of `measure_gains`: its rank among the simulated ones.

        Source: Davison and Hinkley, "Bootstrap Methods and their Application", 1997, section 4.2.
        """
        if not simulated:
            return {}
        return {
            name: (1 + sum(own.gains.get(name, 0.0) >= gain for own in simulated)) / (1 + len(simulated))
            for name, gain in self.measure_gains().items()
        }

    def _count_excluded(self) -> dict[str, int]:
        """Return the number of excluded people by their facts."""
        cases, counts = self._people.cases, dict[str, int]()
        for case in np.flatnonzero(self._fits.is_excluded):
            facts = ", ".join(f"{n}={v}" for n, v in self._people.contexts[cases.contexts[case]].items())
            counts[facts] = counts.get(facts, 0) + round(float(cases.weights[case]))
        return counts

    def _atom(self, statement: int) -> Probability:
        atom = self._program.statements[statement]
        assert isinstance(atom, Probability)
        return atom

    def _complete(self, statements: Iterable[int]) -> tuple[int, ...]:
        """Add the numbers that have to change, too: those of a case that sum to 1, and all of missing rules.

        As nothing is stated by missing rules, there is nothing to return to for one of them.
        """
        own = set(statements)
        for group in self._groups.values():
            if any(self._is_missing(i) for i in own.intersection(group)):
                own.update(group)
        return self._fits.complete(own)

    def _is_missing(self, statement: int) -> bool:
        return statement >= len(self._people.program.statements)

    def _find_gain(self, statements: Collection[int]) -> float:
        """Return twice the gain in log likelihood if these numbers are free."""
        if not statements:
            return 0.0
        return max(2 * (self._fits.fit(statements).log_likelihood - self._stated), 0.0)

    def _find_bic(self, statements: Collection[int]) -> float:
        return self._find_gain(statements) - len(statements) * log(self._n_people)

    def _choose(self) -> tuple[int, ...]:
        """Choose the fewest numbers that have to change: forward and backward selection.

        If numbers of several attributes are wrong, others may make up for them, so that forward selection
        ends in a wrong set. Then the choice begins at all numbers, too.
        """
        chosen = self._select_forward()
        if len({self._atom(i).term.name for i in chosen}) < 2:
            return chosen
        everything = tuple(self._fits.free)
        self._fits.fit(everything, N_STARTS, near=self._fits.fit(chosen))
        return max(chosen, self._reduce(everything), key=self._find_bic)

    def _select_forward(self) -> tuple[int, ...]:
        candidates = self._list_candidates()
        chosen: tuple[int, ...] = ()
        while True:
            refuted = []
            for own in candidates:
                larger = tuple(sorted({*chosen, *own}))
                if larger != chosen and self._is_refuted(*self._compare(larger, chosen)):
                    refuted.append(larger)
            best = self._reduce(max(refuted, key=self._find_bic, default=chosen))
            if self._find_bic(best) <= self._find_bic(chosen):
                return chosen
            chosen = best

    def _list_candidates(self) -> list[tuple[int, ...]]:
        """List single numbers, and all numbers of an attribute."""
        singles = [self._complete((i,)) for i in self._fits.free]
        return list(dict.fromkeys([*singles, *self._groups.values()]))

    def _is_refuted(self, statistic: float, degrees: float) -> bool:
        """Whether numbers are refuted by BIC, and by a test that counts all candidates (Bonferroni)."""
        p_value = float(chi2.sf(statistic, degrees)) * len(self._list_candidates())
        return statistic > degrees * log(self._n_people) and p_value < MAX_CHANGE_P_VALUE

    def _reduce(self, chosen: tuple[int, ...]) -> tuple[int, ...]:
        """Return to the stated numbers one by one, as long as the data do not refute the next."""
        while len(chosen) > 1:
            smaller = [tuple(i for i in chosen if i != own) for own in chosen]
            smaller = [own for own in smaller if self._complete(own) == own]
            for own in smaller:
                self._fits.fit(own, near=self._fits.fit(chosen))
            tests = {own: self._compare(chosen, own) for own in smaller}
            reduced = min(tests, key=lambda own: tests[own][0], default=())
            if not reduced or self._is_refuted(*tests[reduced]):
                break
            chosen = reduced
        return chosen

    def _compare(self, free: Collection[int], known: Collection[int]) -> tuple[float, float]:
        """Test the stated numbers that are free, apart from the known ones, against the fit of the free ones.

        As the rates of senses and answers are estimated before, the likelihood ratio is distributed as a
        weighted sum of chi-squared variables, see `find_ratio_weights`. Wald's statistic is not used: its
        p-values are too small if numbers are weakly determined, as those of hidden identities are, and too
        large if they are wrong together (Hauck and Donner, JASA 72, 1977).

        Returns:
            The statistic, scaled so that it is distributed as chi-squared, and its degrees of freedom.
            Infinity for numbers by which people of the log are impossible.
        """
        scale, degrees = match_chi_squared(find_ratio_weights(self._fits.fit(free), known))
        if self._fits.excluding.intersection(free) - set(known):
            return inf, degrees
        return (self._find_gain(free) - self._find_gain(known)) / scale, degrees

    def _list_rivals(self, chosen: tuple[int, ...]) -> list[Rival]:
        """List other changes that explain the data as well: single numbers, or whole other attributes.

        The chosen numbers fit the data better than the truth by chance, and the others may not.
        """
        scale, degrees = match_chi_squared(find_ratio_weights(self._fits.fit(chosen), ()))
        min_gain = self._find_gain(chosen) - scale * float(chi2.isf(MAX_P_VALUE, degrees))
        numbers = [i for i in self._fits.free if i not in chosen]
        single = [i for i in numbers if self._find_gain(self._complete((i,))) > min_gain]
        if single:
            return [Rival((self._atom(i).left_side,)) for i in single]
        changed = {self._atom(i).term.name for i in chosen}
        worst = max(changed, key=lambda name: self._find_bic(self._groups[name]))
        others, rivals = [name for name in self._groups if name != worst], list[Rival]()
        for size in (1, 2):
            for names in combinations(others, size):
                if any(set(rival.names) <= set(names) for rival in rivals):
                    continue
                own = tuple(sorted(i for name in names for i in self._groups[name]))
                self._fits.fit(own, N_STARTS)
                if self._find_gain(own) > min_gain:
                    rivals.append(Rival(names))
        return rivals

    def _describe(
        self, statements: tuple[int, ...], statement: int, simulated: Sequence[SimulatedFits]
    ) -> NumberEstimate:
        fit = self._fits.fit(statements)
        place = fit.statements.index(statement)
        stated, estimate = float(fit.stated[place]), float(fit.estimates[place])
        variance = float(fit.covariance[place, place])
        atom, gain = self._atom(statement), self._find_gain(fit.statements)
        found = NumberEstimate(
            name=atom.left_side,
            stated=stated,
            estimate=estimate,
            interval=None,
            p_value=1.0,
            statement=atom,
            gain=gain,
            is_missing=self._is_missing(statement),
        )
        if variance > MAX_PRIOR_SHARE * fit.prior_variance[place]:
            return found
        errors = [own.errors[statements, statement] for own in simulated]
        limits = find_limits(errors) if errors else (-Z95, Z95)
        interval, p_value = compare_log_odds(stated, estimate, variance, limits)
        return replace(found, interval=interval, p_value=p_value)

    def _describe_attribute(self, name: str, simulated: Mapping[str, float]) -> AttributeTest:
        own = self._groups[name]
        p_value = simulated[name] if simulated else float(chi2.sf(*self._compare(own, ())))
        return AttributeTest(name, len(own), self._find_gain(own), self._find_bic(own), p_value)


def _guess_rates(people: LoggedPeople, place: int) -> Array:
    """Return (V, L) rates of a sense of which none are stated: its label is rather right than wrong."""
    sense, labels = people.domain.senses[place], people.labels[place]
    rates = np.full((len(people.domain.values), len(labels)), 0.3 / max(len(labels) - 1, 1))
    for row, value in zip(rates, people.domain.values, strict=True):
        row[labels.index(sense.label_of[people.domain.class_of(sense.name, value)])] = 0.7
    return rates
