"""How often an audit names the wrong numbers, and how often its intervals cover the truth.

    OMP_NUM_THREADS=1 python benchmarks/audit.py [--streams 50] [--noise 0.3] [--identities 20] [--seed 0]
        [--rows NAME] [--out TABLE.md]

People are those of the domain `intention`, and the knowledge of the robot is changed. The planner's model
states a noise of .1 (.2 for `greet`), the policy is solved for the true one, as a robot with trust does, and
one person in 20 is asked until they have given three answers. With `--identities 20`, another one in 20 is
asked who they are: the identity is then among the facts of that person.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from lcorpp.domains import Domain, load_domain
from lcorpp.domains.dialogue import DomainDialogue
from lcorpp.experiments.audit.audit import audit_people
from lcorpp.experiments.audit.findings import Audit
from lcorpp.experiments.audit.logged_people import LoggedPeople
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
"""Number of programs with six wrong numbers; further streams begin again."""

ATTRIBUTES: Mapping[str, tuple[str, Mapping[str, float]]] = {
    "location uninformative": ("location", dict.fromkeys(("student", "professor", "visitor"), 0.5)),
    "location inverted": ("location", {"student": 0.7, "professor": 0.9, "visitor": 0.2}),
    "intention half-way to .4": ("intention", {"student": 0.35, "professor": 0.25, "visitor": 0.6}),
    "intention, professor and visitor swapped": ("intention", {"professor": 0.8, "visitor": 0.1}),
    "intention inverted": ("intention", {"student": 0.7, "professor": 0.9, "visitor": 0.2}),
}
"""Attributes of which all numbers are wrong: identity -> the stated number."""

Facts = tuple[tuple[str, str], ...]

HEADER = """| knowledge | noise | streams | named | only that is changed | intervals cover |
|---|---|---|---|---|---|
"""


def main(
    streams: Annotated[int, typer.Option(min=1, help="For each row of the table.")] = 50,
    people: Annotated[int, typer.Option(min=1)] = 2000,
    noise: Annotated[list[float] | None, typer.Option(help="Repeatable; by default .1, .3 and .4.")] = None,
    error: Annotated[float, typer.Option(min=0.01, max=0.5, help="Of the one number that is wrong.")] = 0.2,
    identities: Annotated[int, typer.Option(min=0, help="Ask one person in so many; 0 nobody.")] = 0,
    rows: Annotated[str, typer.Option(help="Rows of the table whose name contains this.")] = "",
    seed: Annotated[int, typer.Option(min=0)] = 0,
    out: Annotated[Path | None, typer.Option(dir_okay=False)] = None,
) -> None:
    """Simulate streams of people and audit them."""
    print(HEADER, end="")
    domain = load_domain("intention", preset="paper")
    text = HEADER
    for level in noise or (0.1, 0.3, 0.4):
        world = World(domain, level)
        chosen = [row for row in list_rows(domain.program, error, seed) if rows in row[0]]
        for name, changes in chosen:
            rng = np.random.default_rng(seed)
            results = []
            for number in range(streams):
                program, wrong = changes[number % len(changes)]
                audit = audit_people(world.simulate(program, people, identities, rng))
                results.append(score(audit, domain.program, wrong))
            columns = ([x for x in column if x is not None] for column in zip(*results, strict=True))
            named, exact, covers = (f"{100 * np.mean(own):.1f} %" if own else "" for own in columns)
            row = f"| {name} | {level:g} | {streams} | {named} | {exact} | {covers} |\n"
            print(row, end="", flush=True)
            text += row
    if out is not None:
        write_atomically(out, text)


def list_rows(
    program: Program, error: float, seed: int
) -> Iterator[tuple[str, list[tuple[Program, frozenset[int]]]]]:
    """Yield the rows of the table: a name, and programs with the statements in which they are wrong."""
    yield "right", [(program, frozenset())]
    numbers = {
        i: float(s.number.value)
        for i, s in enumerate(program.statements)
        if isinstance(s, Probability) and isinstance(s.number, Number) and s.term.name != "classifier"
    }
    singles = []
    for i, stated in numbers.items():
        for shift in (error, -error):
            changed = change(program, {i: stated + shift})
            if changed is not None:
                singles.append((changed, frozenset({i})))
    yield f"one number wrong by {error:g}", singles
    for name, (attribute, by_identity) in ATTRIBUTES.items():
        wrong = {
            i: by_identity[next(v for v in by_identity if f"identity={v}" in str(program.statements[i]))]
            for i in numbers
            if str(program.statements[i]).startswith(f"pr({attribute}=")
            and any(f"identity={v}" in str(program.statements[i]) for v in by_identity)
        }
        changed = change(program, wrong)
        assert changed is not None
        yield name, [(changed, frozenset(wrong))]
    yield "six numbers wrong", draw_changes(program, numbers, np.random.default_rng([seed, 6]))


def draw_changes(
    program: Program, numbers: Mapping[int, float], rng: np.random.Generator
) -> list[tuple[Program, frozenset[int]]]:
    """Draw programs with six wrong numbers, each uniform in .05 to .95 and at least .2 from the right one."""
    drawn = list[tuple[Program, frozenset[int]]]()
    while len(drawn) < N_DRAWN:
        wrong = dict(
            zip(rng.permutation(list(numbers))[:6].tolist(), rng.uniform(0.05, 0.95, 6), strict=True)
        )
        if all(abs(numbers[i] - p) >= 0.2 for i, p in wrong.items()):
            changed = change(program, wrong)
            if changed is not None:
                drawn.append((changed, frozenset(wrong)))
    return drawn


def change(program: Program, numbers: Mapping[int, float]) -> Program | None:
    """Return the program with other numbers; None if they are no probabilities."""
    statements, sums = list(program.statements), dict[str, float]()
    for i, statement in enumerate(program.statements):
        if isinstance(statement, Probability) and isinstance(statement.number, Number):
            number = Fraction(round(numbers.get(i, float(statement.number.value)), 6)).limit_denominator(1000)
            statements[i] = replace(statement, number=Number(number))
            case = f"{statement.term} {statement.body}"
            sums[case] = sums.get(case, 0) + float(number)
            if number < Fraction(1, 100) or sums[case] > 0.99:
                return None
    return Program(program.file, tuple(statements), program.semantics)


def score(audit: Audit, right: Program, wrong: frozenset[int]) -> tuple[bool | None, bool, float | None]:
    """Return whether what is wrong is the worst, whether exactly that is changed, and the coverage.

    The intervals of right knowledge are all alone; of wrong knowledge those of the numbers to change.
    """
    names = {str(right.statements[i]).rpartition(" = ")[0] for i in wrong}
    truth = {
        str(s).rpartition(" = ")[0]: float(s.number.value)
        for s in right.statements
        if isinstance(s, Probability) and isinstance(s.number, Number)
    }
    exact = {x.name for x in audit.changes} == names
    findings = audit.changes
    named: bool | None = None
    if not wrong:
        findings = audit.numbers
    elif len(wrong) == 1:
        findings = [x for x in audit.numbers if x.name in names]
        named = max(audit.numbers, key=lambda x: x.gain).name in names
    else:
        attributes = {name[3:].partition("=")[0] for name in names}
        if len(attributes) == 1:
            named = max(audit.attributes, key=lambda x: x.bic).name in attributes
    covers = [x.interval[0] < truth[x.name] < x.interval[1] for x in findings if x.interval is not None]
    return named, exact, float(np.mean(covers)) if covers else None


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
            identities: one person in so many has its identity among the facts; 0: nobody.
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
            self._domain, program, self._dialogue, names, labels, [RATES], cases, "LCORPP", 0, {}
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
