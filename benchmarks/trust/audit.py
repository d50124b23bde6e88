"""How often an audit names the wrong numbers, and how often its intervals cover the truth.

    OMP_NUM_THREADS=1 python benchmarks/trust/audit.py [--streams 50] [--noise 0.3] [--identities 20]
        [--facts sampled] [--seed 0] [--rows NAME] [--out TABLE.md]

People are those of the domain `intention`, and the knowledge of the robot is changed. The planner's model
states a noise of .1 (.2 for `greet`), the policy is solved for the true one, as a robot with trust does, and
one person in 20 is asked until they have given three answers. With `--identities 20`, another one in 20 is
asked who they are: the identity is then among the facts of that person.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from fractions import Fraction
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
import typer

from lcorpp.audit.audit import audit_people
from lcorpp.audit.estimates import Audit
from lcorpp.audit.logged_people import LoggedPeople
from lcorpp.domains import Domain, load_domain
from lcorpp.domains.dialogue import DomainDialogue
from lcorpp.files import write_atomically
from lcorpp.planning import Planner, SparseTables, solve
from lcorpp.reasoning import Program, Reasoner
from lcorpp.reasoning.language.syntax import Number, Probability
from lcorpp.simulation.people import Population
from lcorpp.trust.cases import Cases
from lcorpp.values import Array

RATES = np.array([[0.76, 0.24], [0.29, 0.71]])
"""P(label | value) of the classifier."""

REPEATED_EVERY, REPEATED_ANSWERS = 20, 3
"""Every 20th person is asked until they have given three answers."""

N_DRAWN = 200
"""Number of programs with six wrong numbers; further streams repeat them."""

Facts = tuple[tuple[str, str], ...]


class FactsSource(StrEnum):
    """Where the facts come from, for the audit."""

    SAMPLED = "sampled"
    GIVEN = "given"


ATTRIBUTES = ("time", "location", "intention")
"""Attributes of which all numbers are wrong in some rows."""

HEADER = """| knowledge | noise | facts | streams | named | or a rival | exact | cover |
|---|---|---|---|---|---|---|---|
"""

Row = tuple[str, list[tuple[Program, frozenset[str]]]]
"""Name, and programs with the names of the pr-atoms in which they are wrong: each stream has the next one."""


def main(
    streams: Annotated[int, typer.Option(min=1, help="For each row of the table.")] = 50,
    people: Annotated[int, typer.Option(min=1)] = 2000,
    noise: Annotated[list[float] | None, typer.Option(help="Repeatable; by default .1, .3 and .4.")] = None,
    error: Annotated[float, typer.Option(min=0.01, max=0.5, help="Of the one number that is wrong.")] = 0.2,
    identities: Annotated[int, typer.Option(min=0, help="Ask every k-th person who they are; 0: none.")] = 0,
    rows: Annotated[str, typer.Option(help="Rows of the table whose name contains this.")] = "",
    facts: Annotated[list[FactsSource] | None, typer.Option(help="Repeatable; by default both.")] = None,
    seed: Annotated[int, typer.Option(min=0)] = 0,
    out: Annotated[Path | None, typer.Option(dir_okay=False)] = None,
) -> None:
    """Simulate streams of people and audit them, with facts sampled from the program or given."""
    print(HEADER, end="")
    domain = load_domain("intention", preset="paper")
    text = HEADER
    for level in noise or (0.1, 0.3, 0.4):
        world = World(domain, level)
        for name, changes in list_rows(domain.program, error, seed):
            if rows not in name:
                continue
            rng = np.random.default_rng(seed)
            results: dict[FactsSource, list[Score]] = {kind: [] for kind in facts or FactsSource}
            for number in range(streams):
                program, wrong = changes[number % len(changes)]
                logged = world.simulate(program, people, identities, rng)
                for kind, scores in results.items():
                    audit = audit_people(logged, given=kind is FactsSource.GIVEN)
                    scores.append(score(audit, domain.program, wrong))
            for kind, scores in results.items():
                cells = " | ".join(map(summarise, zip(*scores, strict=True)))
                row = f"| {name} | {level:g} | {kind} | {streams} | {cells} |\n"
                print(row, end="", flush=True)
                text += row
    if out is not None:
        write_atomically(out, text)


def summarise(column: Sequence[float | None]) -> str:
    """Return the mean of the numbers that are not None."""
    own = [x for x in column if x is not None]
    return f"{100 * np.mean(own):.1f} %" if own else ""


def list_rows(program: Program, error: float, seed: int) -> Iterator[Row]:
    """List the rows of the table."""
    yield "right", [(program, frozenset())]
    numbers = find_numbers(program)
    shifted = [{name: p + shift} for name, p in numbers.items() for shift in (error, -error)]
    singles = [wrong for wrong in shifted if are_probabilities({**numbers, **wrong})]
    yield f"one number wrong by {error:g}", [(change(program, x), frozenset(x)) for x in singles]
    for attribute in ATTRIBUTES:
        own = {n: p for n, p in numbers.items() if n.startswith(f"pr({attribute}=")}
        n_values = len(program.attributes[attribute].values)
        swapped = {n: own[swap(n, "professor", "visitor")] for n in own}
        for what, wrong in (
            ("missing", dict.fromkeys(own)),
            ("professor and visitor exchanged", swapped),
            ("inverted", {n: (1 - p) / (n_values - 1) for n, p in own.items()}),
        ):
            yield (
                f"{attribute}: {what}",
                [(change(program, wrong), frozenset(n for n in own if wrong[n] != own[n]))],
            )

    drawn = draw_numbers(numbers, np.random.default_rng([seed, 6]))
    yield "six numbers wrong", [(change(program, wrong), frozenset(wrong)) for wrong in drawn]


def draw_numbers(numbers: Mapping[str, float], rng: np.random.Generator) -> list[dict[str, float]]:
    """Draw six wrong numbers at a time, each uniform in .05 to .95 and at least .2 from the right one."""
    drawn, names = list[dict[str, float]](), list(numbers)
    while len(drawn) < N_DRAWN:
        chosen = rng.permutation(len(names))[:6]
        wrong = {names[i]: round(p, 3) for i, p in zip(chosen, rng.uniform(0.05, 0.95, 6), strict=True)}
        is_far = all(abs(numbers[name] - p) >= 0.2 for name, p in wrong.items())
        if is_far and are_probabilities({**numbers, **wrong}):
            drawn.append(wrong)
    return drawn


def are_probabilities(numbers: Mapping[str, float]) -> bool:
    """Whether numbers are at least .01, and those under the same condition sum to at most 1."""
    sums = dict[str, float]()
    for name, p in numbers.items():
        case = name.partition("=")[0] + name.partition("|")[2]
        sums[case] = sums.get(case, 0) + p
    return min(numbers.values()) >= 0.01 and max(sums.values()) <= 1 + 1e-9


def find_numbers(program: Program) -> dict[str, float]:
    """Return the numbers of the pr-atoms, apart from the classifier's."""
    return {
        str(s).rpartition(" = ")[0]: float(s.number.value)
        for s in program.statements
        if isinstance(s, Probability) and isinstance(s.number, Number) and s.term.name != "classifier"
    }


def swap(text: str, one: str, other: str) -> str:
    return text.replace(one, "?").replace(other, one).replace("?", other)


def change(program: Program, numbers: Mapping[str, float | None]) -> Program:
    """Return the program with other numbers, and without the pr-atoms of None."""
    statements = []
    for statement in program.statements:
        name = str(statement).rpartition(" = ")[0]
        if name not in numbers:
            statements.append(statement)
        elif (number := numbers[name]) is not None:
            assert isinstance(statement, Probability)
            statements.append(replace(statement, number=Number(Fraction(number).limit_denominator(1000))))
    return Program(program.file, tuple(statements), program.semantics)


class Score(NamedTuple):
    """What an audit found.

    named: whether the wrong number has the largest gain, or the wrong attribute the largest BIC; None if
    nothing is wrong. rival: whether it is named, or listed as not identifiable.
    exact: whether the changes are exactly the wrong numbers. covers: share of the 95 % intervals with the
    true number in them: of all numbers if nothing is wrong, of the wrong number, or of those to change.
    """

    named: bool | None
    rival: bool | None
    exact: bool
    covers: float | None


def score(audit: Audit, right: Program, wrong: frozenset[str]) -> Score:
    """Compare an audit with the right program; `wrong` are the names of the pr-atoms that are not."""
    truth, estimates = find_numbers(right), audit.changes
    named: bool | None = None
    if not wrong:
        estimates = audit.numbers
    elif len(wrong) == 1:
        estimates = [x for x in audit.numbers if x.name in wrong]
        named = max(audit.numbers, key=lambda x: x.gain).name in wrong
    attributes = {name[3:].partition("=")[0] for name in wrong}
    if len(attributes) == 1 and len(wrong) > 1:
        named = max(audit.attributes, key=lambda x: x.bic).name in attributes
    rivals = {part for rival in audit.rivals for part in rival.names}
    is_rival = None if named is None else named or bool(rivals & (wrong | attributes))
    covers = [x.interval[0] < truth[x.name] < x.interval[1] for x in estimates if x.interval is not None]
    exact = {x.name for x in audit.changes} == wrong
    return Score(named, is_rival, exact, float(np.mean(covers)) if covers else None)


@dataclass(frozen=True, eq=False)
class Robot:
    """The planner, and its actions after the histories that have occurred."""

    planner: Planner
    actions: dict[object, str]


class World:
    """People whose answers are noisy, and a robot that knows the noise."""

    def __init__(self, domain: Domain, noise: float) -> None:
        self._domain, self._noise, self._population = domain, noise, Population(domain)
        self._dialogue = DomainDialogue(domain)
        observation = domain.pomdp.observation.dense.copy()
        yes, no = (domain.pomdp.observations.index(name) for name in ("pos", "neg"))
        for row in observation.reshape(-1, observation.shape[2]):
            if row[yes] + row[no] == 1:
                likely = row[yes] > row[no]
                row[[yes, no]] = (1 - noise, noise) if likely else (noise, 1 - noise)
        model = replace(domain.pomdp, observation=SparseTables.of(observation))
        solution = solve(model, domain.start_beliefs(), precision=0.1)
        self._robot = Robot(Planner(solution), {})
        self._reasoner = Reasoner(domain.program)

    def simulate(self, program: Program, n: int, identities: int, rng: np.random.Generator) -> LoggedPeople:
        """Simulate decisions; the robot's priors are right, the audit is of `program`.

        Args:
            identities: k: every k-th person has its identity among the facts; 0: none.
        """
        contexts = dict[Facts, int]()
        cases = Cases(1, self._dialogue.tables.shape[0] * self._dialogue.tables.shape[2])
        values = self._domain.values
        for i, person in enumerate(self._population.sample(n, rng)):
            is_known = identities > 0 and i % identities == identities // 2
            observed = (*self._domain.observed, *(["identity"] if is_known else []))
            facts = tuple((name, person[name]) for name in observed)
            value = values.index(person["intention"])
            label = int(rng.random() > RATES[value, 0])
            history = self._decide(facts, label, value, i % REPEATED_EVERY == 0, rng)
            answers = self._dialogue.find_answers(history)
            cases.add(contexts.setdefault(facts, len(contexts)), [label], answers)
        names = [dict(facts) for facts in contexts]
        labels = [["one", "zero"]]
        return LoggedPeople(
            self._domain, program, self._dialogue, names, labels, [RATES], cases, "LCORPP", 0, {}, {}
        )

    def _decide(
        self, facts: Facts, label: int, value: int, is_asked: bool, rng: np.random.Generator
    ) -> list[tuple[str, str]]:
        robot, history = self._robot, list[tuple[str, str]]()
        belief: Array | None = None
        while True:
            key = facts, label, tuple(history)
            if belief is None or key not in robot.actions:
                belief = self._find_prior(facts, label) if belief is None else belief
                robot.actions.setdefault(key, robot.planner.action(belief))
            action = robot.actions[key]
            if self._domain.reported_value(action) is not None:
                if not is_asked or len(history) >= REPEATED_ANSWERS:
                    return history
                action = "greet"
            is_wrong = rng.random() < self._noise
            history.append((action, "pos" if (value == 0) != is_wrong else "neg"))
            belief = robot.planner.update(belief, *history[-1])

    def _find_prior(self, facts: Facts, label: int) -> Array:
        evidence = dict([*facts, ("classifier", ("one", "zero")[label])])
        return self._domain.prior(self._reasoner.posterior("intention", evidence))


if __name__ == "__main__":
    typer.run(main)
