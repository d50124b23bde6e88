"""The domain `intention` with other numbers, noise, rates and costs than those that the robot assumes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from lcorpp.decision import Robot, Strategy, dt_control
from lcorpp.domains import Domain, load_domain
from lcorpp.planning import Planner, SparseTables, solve
from lcorpp.protocols import Planner as PlannerProtocol, Reasoner as ReasonerProtocol
from lcorpp.reasoning import Program, parse_plog
from lcorpp.scoring.exact_evaluation import evaluate_exactly
from lcorpp.simulation import NoisyChannel
from lcorpp.simulation.people import Population
from lcorpp.simulation.table_dynamics import SimulationModel
from lcorpp.trust import Trust
from lcorpp.values import Instance

TIME_NUMBERS = {"student": (0.15, 0.15), "professor": (0.8, 0.1), "visitor": (0.1, 0.7)}
LIBRARY_NUMBERS = {"student": 0.3, "professor": 0.1, "visitor": 0.8}
INTENTION_NUMBERS = {"student": 0.3, "professor": 0.1, "visitor": 0.8}
STATED_RATES = (0.76, 0.29)
"""P(one | interested) and P(one | not interested) of the classifier."""
QUESTIONS = ("move_forward", "greet", "turn")
BASELINES = ("P", "R+P", "L+P", "LCORPP")

Numbers = tuple[Mapping[str, tuple[float, float]], Mapping[str, float], Mapping[str, float]]
"""Identity -> P(morning), P(afternoon); identity -> P(library); identity -> P(interested)."""

RIGHT: Numbers = TIME_NUMBERS, LIBRARY_NUMBERS, INTENTION_NUMBERS


@dataclass(frozen=True)
class World:
    """The people's numbers are `RIGHT`; the robot's observation model stays as stated (.1 and .2).

    numbers: in the robot's program. noise: rate of wrong answers. rates: the true ones of the classifier;
    stated: those in the program. cost: factor of the costs of questions.
    """

    numbers: Numbers
    noise: float
    rates: tuple[float, float] = STATED_RATES
    stated: tuple[float, float] = STATED_RATES
    cost: float = 1.0


def make_program(text: str, numbers: Numbers, rates: tuple[float, float]) -> Program:
    """Return the program of the domain with other numbers."""
    times, library, interested = numbers
    lines = [line for line in text.splitlines() if not line.startswith("pr(")]
    for identity in TIME_NUMBERS:
        for time, p in zip(("morning", "afternoon"), times[identity], strict=True):
            lines.append(f"pr(time={time} | identity={identity}) = {p!r}.")
        lines.append(f"pr(location=library | identity={identity}) = {library[identity]!r}.")
        lines.append(f"pr(intention=interested | identity={identity}) = {interested[identity]!r}.")
    for value, rate in zip(("interested", "not_interested"), rates, strict=True):
        lines.append(f"pr(classifier=one | intention={value}) = {rate!r}.")
    return parse_plog("\n".join(lines))


def make_domain(world: World, *, omniscient: bool = False) -> Domain:
    """Return the domain of a world; that of the omniscient robot knows program, rates and noise."""
    domain = load_domain("intention", preset="paper")
    text = (domain.folder / "knowledge.plog").read_text()
    truth = make_program(text, RIGHT, world.rates)
    program = truth if omniscient else make_program(text, world.numbers, world.stated)
    pomdp, heard = domain.pomdp, domain.simulation.feedback_model.copy()
    reward, observation = pomdp.reward.copy(), pomdp.observation.dense.copy()
    for action in QUESTIONS:
        a = pomdp.action_index(action)
        reward[a] *= world.cost
        answered = heard[a, :, 2] == 0  # not after a turn that failed
        right = heard[a, answered].argmax(axis=1)
        heard[a, answered, :2] = world.noise
        heard[a, np.flatnonzero(answered), right] = 1 - world.noise
        if omniscient:
            observation[a, answered] = heard[a, answered]
    channel = {
        value: {"one": rate, "zero": 1 - rate}
        for value, rate in zip(("interested", "not_interested"), world.rates, strict=True)
    }
    return replace(
        domain,
        reasoning=replace(domain.reasoning, program=program),
        planning=replace(
            domain.planning,
            model=replace(pomdp, reward=reward, observation=SparseTables.of(observation)),
        ),
        simulation=replace(
            domain.simulation,
            true_program=truth,
            feedback_model=heard,
            noisy_channels={sense.name: channel for sense in domain.senses},
        ),
    )


def solve_precisely(domain: Domain) -> Planner:
    """Return the planner of the domain's model."""
    return Planner(solve(domain.pomdp, domain.start_beliefs(), precision=0.01))


def score_exactly(
    domain: Domain, reasoner: ReasonerProtocol, planner: PlannerProtocol, rows: Sequence[Strategy]
) -> dict[str, float]:
    """Return the exact mean returns of strategies."""
    channels = make_channels(domain)
    robot = Robot(channels, reasoner, planner, domain)
    found = evaluate_exactly(domain, robot, channels, tuple(rows))
    return {scores.strategy: scores.return_.estimate for scores in found}


def make_channels(domain: Domain) -> dict[str, NoisyChannel]:
    """Return the simulated classifier of each sense."""
    return {sense.name: NoisyChannel.from_domain(domain, sense) for sense in domain.senses}


def meet_people(
    domain: Domain,
    trust: Trust,
    people: int,
    rng: np.random.Generator,
    others: Domain | None = None,
    share: float = 0.0,
) -> Iterator[float]:
    """Yield the return of each person of a stream, after trust has learnt from the person.

    Args:
        others: a share of the people answers as in this domain.
    """
    crowd, channels = Population(domain).sample(people, rng), make_channels(domain)
    signals = {name: channel.simulate(crowd, rng) for name, channel in channels.items()}
    model, other_model = SimulationModel(domain), SimulationModel(others or domain)
    for i, person in enumerate(crowd):
        perceived = {name: own[i] for name, own in signals.items()}
        instance = Instance(perceived, {name: person[name] for name in domain.observed})
        is_other = share > 0 and rng.random() < share
        world = (other_model if is_other else model).make_world(person, rng)
        episode = dt_control(Robot(channels, trust, trust.make_planner(), domain), instance, world)
        trust.learn(episode.evidence, episode.steps)
        yield world.return_
