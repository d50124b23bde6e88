"""Alarms on simulated people: how often without a fault, how soon with one, and which attribute they name.

    OMP_NUM_THREADS=1 python benchmarks/trust/alarm.py [--streams 40] [--false-alarms 1000] [--seed 0]
        [--trust]

The robot has wrong knowledge, or the classifier has other rates than those stated. Its decisions are those of
LCORPP, or with --trust those of a robot that learns whom to trust. For each noise of people's answers: the
median number of people until the alarm, and the share of the alarms that name the right attribute; before the
slash if the program predicts facts, too, after it if these are given. Then the false alarms if all knowledge
is right, of people with the same noise for all questions (not on the grid of the alarm's degrees), of people
with a degree of noise on this grid, and of people with biased answers.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import cache
from time import process_time
from typing import Annotated, NamedTuple
from zlib import crc32

import numpy as np
import typer

from lcorpp.assembly.strategies.trust_setup import set_up_trust
from lcorpp.decision import Robot, dt_control
from lcorpp.domains import Domain, load_domain
from lcorpp.logs.watching import make_alarm, make_hypotheses
from lcorpp.planning import Planner, Pomdp, solve
from lcorpp.protocols import World
from lcorpp.reasoning import Program, Reasoner, parse_plog
from lcorpp.simulation.people import Population
from lcorpp.simulation.table_dynamics import SimulationModel
from lcorpp.trust import Finding, Hypotheses
from lcorpp.trust.finding import HEARING, KNOWLEDGE
from lcorpp.values import Array, Belief, Instance, Label, Step

Numbers = Mapping[str, float]
"""A pr-atom, such as ``location=library | identity=student`` -> its number."""

Decision = tuple[Mapping[str, Label], tuple[Step, ...]]
"""Evidence and steps."""

NOISES = (0.1, 0.2, 0.3, 0.4)
N_PEOPLE = 2000


class Answers(NamedTuple):
    """How people answer: with an error rate of all questions, or with a degree of noise; and with a bias."""

    name: str
    noise: float | None = None
    degree: float = 0.0
    bias: float = 0.0

    def change(self, rows: Array) -> Array:
        """Return P(answer | value) for stated rows (..., 2)."""
        if self.noise is not None:
            rows = np.where(rows > 0.5, 1 - self.noise, self.noise)
        rows = (1 - self.degree) * rows + self.degree / 2
        return (1 - self.bias) * rows + self.bias * np.array([1.0, 0.0])


RIGHT_KNOWLEDGE = (
    *(Answers(f"error rate {noise}", noise=noise) for noise in NOISES),
    Answers("as stated"),
    *(Answers(f"degree {degree}", degree=degree) for degree in (0.25, 0.5, 0.75)),
    Answers("biased by .3", bias=0.3),
)
"""Answers in the streams without a fault of the knowledge."""


class Fault(NamedTuple):
    """Wrong numbers of the robot's program, none if rules are missing; if `is_true`, those of the world."""

    attribute: str
    numbers: Numbers
    is_true: bool = False


def list_test_faults() -> dict[str, Fault]:
    def rows(head: str, *numbers: float) -> Numbers:
        people = ("student", "professor", "visitor")
        return {f"{head} | identity={name}": p for name, p in zip(people, numbers, strict=True)}

    def times(morning: tuple[float, ...], afternoon: tuple[float, ...]) -> Fault:
        return Fault("time", {**rows("time=morning", *morning), **rows("time=afternoon", *afternoon)})

    def rates(one: float, zero: float) -> Fault:
        atom = "classifier=one | intention"
        return Fault("classifier", {f"{atom}=interested": one, f"{atom}=not_interested": zero}, is_true=True)

    location, intention = "location=library", "intention=interested"
    return {
        "location missing": Fault("location", rows(location, 0.5, 0.5, 0.5)),
        "time missing": times((1 / 3,) * 3, (1 / 3,) * 3),
        "intention halfway to .4": Fault("intention", rows(intention, 0.35, 0.25, 0.6)),
        "intention swapped": Fault("intention", rows(intention, 0.3, 0.8, 0.1)),
        "intention inverted": Fault("intention", rows(intention, 0.7, 0.9, 0.2)),
        "time swapped": times((0.15, 0.1, 0.8), (0.15, 0.7, 0.1)),
        "locations exchanged": Fault("location", rows(location, 0.7, 0.9, 0.2)),
        "location rules removed": Fault("location", {}),
        "time rules removed": Fault("time", {}),
        "classifier .50/.50": rates(0.5, 0.5),
        "classifier .60/.40": rates(0.6, 0.4),
        "classifier .90/.10": rates(0.9, 0.1),
        "classifier .594/.119": rates(0.594, 0.119),
        "classifier .29/.76": rates(0.29, 0.76),
    }


def change_program(program: Program, numbers: Numbers) -> Program:
    """Return a program with other numbers."""
    text = str(program)
    for atom, number in numbers.items():
        text, count = re.subn(rf"(pr\({re.escape(atom)}\) = )\S+\.(?=\n|$)", rf"\g<1>{number:.6f}.", text)
        if count != 1:
            raise ValueError(f"{count} pr-atoms {atom!r}; expected 1")
    return parse_plog(text, file=program.file)


def make_domain(fault: Fault | None, answers: Answers) -> Domain:
    """Return the domain of a robot with a fault, in a world whose people answer like this."""
    domain = load_domain("intention")
    simulation = domain.simulation
    feedback = domain.pomdp.observation.dense.copy()  # (actions, states, observations)
    is_answer = feedback[:, :, :2].sum(axis=2) > 0
    feedback[is_answer, :2] = answers.change(feedback[is_answer, :2])
    known, truth = domain.program, simulation.true_program
    if fault is not None and fault.is_true:
        truth = change_program(truth, fault.numbers)
    elif fault is not None and fault.numbers:
        known = change_program(known, fault.numbers)
    elif fault is not None:
        rules = re.sub(rf"(?m)^pr\({fault.attribute}=.*\n", "", str(known))
        known = parse_plog(rules, file=known.file)
    own = replace(domain, reasoning=replace(domain.reasoning, program=known))
    return replace(own, simulation=replace(simulation, true_program=truth, feedback_model=feedback))


class Decider:
    """LCORPP's decisions; each point of a decision is computed once."""

    def __init__(self, domain: Domain) -> None:
        self._domain, self._reasoner = domain, Reasoner(domain.program)
        self._planner = solve_planner(domain.pomdp)
        self._labels = Reasoner(domain.simulation.true_program)
        self._start = cache(self._infer)
        self._actions = dict[tuple[object, ...], tuple[str, Belief]]()

    def _infer(self, *evidence: tuple[str, Label]) -> Belief:
        return self._domain.prior(self._reasoner.posterior(self._domain.shared, dict(evidence)))

    def decide(self, evidence: Mapping[str, Label], world: World) -> tuple[Step, ...]:
        belief, steps = self._start(*evidence.items()), list[Step]()
        key: tuple[object, ...] = tuple(evidence.items())
        while True:
            if key not in self._actions:
                self._actions[key] = self._planner.action(belief), belief
            action, belief = self._actions[key]
            if self._domain.reported_value(action) is not None:
                return tuple(steps)
            observation = world.act(action)
            steps.append(Step(action, observation, belief))
            key = (*key, observation)
            if key not in self._actions:
                belief = self._planner.update(belief, action, observation)


@cache
def solve_planner(pomdp: Pomdp) -> Planner:
    return Planner(solve(pomdp, load_domain("intention").start_beliefs(), precision=0.1))


def draw_decisions(domain: Domain, rng: np.random.Generator, decider: Decider | None) -> Iterator[Decision]:
    """Yield the decisions about a stream of people; without a decider those of a robot with trust."""
    people, model = Population(domain).sample(N_PEOPLE, rng), SimulationModel(domain)
    sense = domain.senses[0]
    truth = Reasoner(domain.simulation.true_program)
    rates = {
        value: truth.posterior(sense.attribute, {sense.of: value}).probabilities for value in sense.classes
    }
    labels = [sense.classes[int(rng.random() >= rates[person[sense.of]][0])] for person in people]
    trust = None
    if decider is None:
        trust = set_up_trust(domain, Reasoner(domain.program), solve_planner(domain.pomdp))
    for person, label in zip(people, labels, strict=True):
        facts, world = {name: person[name] for name in domain.observed}, model.make_world(person, rng)
        if trust is None:
            assert decider is not None
            evidence = domain.evidence(facts, {sense.name: label})
            yield evidence, decider.decide(evidence, world)
        else:
            robot = Robot({sense.name: FixedLabel(label)}, trust, trust.make_planner(), domain)
            episode = dt_control(robot, Instance({sense.name: np.zeros((1, 1))}, facts), world)
            trust.learn(episode.evidence, episode.steps)
            yield episode.evidence, episode.steps


class FixedLabel(NamedTuple):
    label: str

    def classify(self, signal: object) -> str:
        return self.label


def watch(
    domain: Domain, hypotheses: list[Hypotheses], rng: np.random.Generator, decider: Decider | None
) -> list[list[Finding]]:
    """Return the alarms of one stream by each set of hypotheses, until all have one about the knowledge."""
    alarms = [make_alarm(domain, own) for own in hypotheses]
    for evidence, steps in draw_decisions(domain, rng, decider):
        for alarm in alarms:
            if find(KNOWLEDGE, alarm.findings) is None:
                alarm.update(evidence, steps)
        if all(find(KNOWLEDGE, alarm.findings) for alarm in alarms):
            break
    return [alarm.findings for alarm in alarms]


def find(part: str, findings: list[Finding]) -> Finding | None:
    return next((finding for finding in findings if finding.part == part), None)


def list_hypotheses(fault: Fault | None) -> list[Hypotheses]:
    """Return a robot's hypotheses if the program predicts the facts, and if they are given."""
    domain = make_domain(fault, Answers("as stated"))
    return [make_hypotheses(domain, given=given) for given in (False, True)]


def main(
    streams: Annotated[int, typer.Option(help="Streams for each fault and noise.")] = 40,
    false_alarms: Annotated[int, typer.Option(help="Streams without a fault.")] = 1000,
    seed: int = 0,
    trust: Annotated[bool, typer.Option("--trust", help="The decisions are those of trust.")] = False,
    only: Annotated[str, typer.Option(help="Part of the names of faults, or of answers.")] = "",
) -> None:
    """Print a table of the faults, and one of the alarms without a fault of the knowledge."""
    faults = {name: fault for name, fault in list_test_faults().items() if only in name}
    if faults and streams:
        print_row("fault", *(f"noise {noise}" for noise in NOISES), is_head=True)
    for name, fault in faults.items() if streams else ():
        cells = list[str]()
        hypotheses = list_hypotheses(fault)
        for noise in NOISES:
            domain = make_domain(fault, Answers("", noise=noise))
            decider = None if trust else Decider(domain)
            key = [seed, crc32(name.encode()), int(100 * noise)]
            found = [
                watch(domain, hypotheses, np.random.default_rng([*key, s]), decider) for s in range(streams)
            ]
            own = [[find(KNOWLEDGE, row[i]) for row in found] for i in range(2)]
            cells.append(" / ".join(describe(findings, fault) for findings in own))
        print_row(name, *cells)
    worlds = [answers for answers in RIGHT_KNOWLEDGE if only in answers.name] if false_alarms else []
    hypotheses = list_hypotheses(None) if worlds else []
    if worlds:
        print()
        print_row("answers", "streams", "alarms about the knowledge", "about hearing", is_head=True)
    for n, answers in enumerate(worlds):
        domain = make_domain(None, answers)
        decider = None if trust else Decider(domain)
        own_streams = range(n, false_alarms, len(worlds))
        found = [watch(domain, hypotheses, np.random.default_rng([seed, s]), decider) for s in own_streams]
        counts = [
            " / ".join(str(sum(find(part, row[i]) is not None for row in found)) for i in range(2))
            for part in (KNOWLEDGE, HEARING)
        ]
        print_row(answers.name, str(len(own_streams)), *counts)
    print(f"\nseed {seed}, {process_time():.0f} s of CPU")


def print_row(*cells: str, is_head: bool = False) -> None:
    """Print a row of a Markdown table."""
    print(f"| {' | '.join(cells)} |", flush=True)
    if is_head:
        print("|" + "---|" * len(cells))


def describe(found: list[Finding | None], fault: Fault) -> str:
    """Return the median number of people, and the share of alarms that name the right attribute."""
    people = [np.inf if finding is None else finding.person for finding in found]
    named = [finding.attributes[0] == fault.attribute for finding in found if finding is not None]
    right = f"{100 * np.mean(named):.0f}%" if named else "-"
    return f"{np.median(people):.0f} {right}"


if __name__ == "__main__":
    typer.run(main)
