"""Attention by events alone, without motion: many loads, kinds of patience and sizes of the place.

    OMP_NUM_THREADS=1 python benchmarks/robot/attention_events.py [--hours 60] [--seed 0]

People come by a Poisson process with a calibrated P(interested) around .85, .6, .3 and .1; a decision takes
as long as the policy's forecast, on average; hazards and q are learnt from nothing. Paired differences by
hour, 95 %.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import product
from typing import Annotated

import numpy as np
import typer
from forecast import Forecast
from rich.console import Console
from scipy.special import expit, logit

from lcorpp import Planner, load_domain
from lcorpp.assembly import solve_domain
from lcorpp.decision.attention import Candidate, ServedShare, choose_candidate, find_delay
from lcorpp.decision.patience import Patience
from lcorpp.values import Array

GROUPS, SPREAD = ((0.85, 0.6, 0.3, 0.1), (0.25, 0.25, 0.3, 0.2)), 0.3
"""P(interested) and share of the groups of people; standard deviation of the log-odds in a group."""
TURNING, SERVICE, SECONDS_SHAPE = 0.5, 5.0, 4.0
"""Seconds before the first action; seconds of the service; gamma shape of the duration of a decision."""
PATIENCE = {"40": (40.0, 40.0), "70 or 10": (70.0, 10.0), "60 or 20": (60.0, 20.0)}
SHAPES, RATES, ROOMS = (1.0, 4.0, 50.0), (3.0, 7.5, 15.0), (3, 5, 10)

Choose = Callable[[list[Candidate]], object]


@dataclass(frozen=True)
class Person:
    """candidate: as the robot sees them, without a hazard. stay: seconds until they leave by themselves.

    duration: of the decision. is_served: whether it serves an interested person.
    """

    arrival: float
    kind: int
    stay: float
    candidate: Candidate
    duration: float
    is_served: bool


def draw_people(
    forecast: Forecast,
    rng: np.random.Generator,
    hours: int,
    rate: float,
    means: tuple[float, float],
    shape: float,
) -> list[Person]:
    """Draw the people of some hours. rate: per minute. means, shape: of the patience of the two kinds."""
    people = list[Person]()
    for number, arrival in enumerate(np.sort(rng.uniform(0, 3600 * hours, rng.poisson(60 * rate * hours)))):
        group = rng.choice(GROUPS[0], p=GROUPS[1])
        probability = float(expit(logit(group) + SPREAD * rng.standard_normal()))
        value, seconds = forecast.of(round(100 * probability), SERVICE)
        kind, served = int(rng.integers(2)), bool(rng.uniform() < value)
        duration = TURNING + (seconds - SERVICE * value) * rng.gamma(SECONDS_SHAPE) / SECONDS_SHAPE
        stay = means[kind] * rng.gamma(shape) / shape
        candidate = Candidate(number, probability, value, TURNING + seconds, 0.0)
        people.append(Person(float(arrival), kind, stay, candidate, duration + SERVICE * served, served))
    return people


def find_person(people: list[Person], number: object) -> Person:
    """Return the person whom a candidate stands for."""
    assert isinstance(number, int)
    return people[number]


def simulate(
    people: list[Person], choose: Choose, room: int, hours: int, learners: Learners | None = None
) -> Array:
    """Return the number of people served who come in each hour (hours,)."""
    served, waiting, coming, now = np.zeros(hours), list[Person](), list(reversed(people)), 0.0
    before = 0.0

    def advance(time: float, attended: int) -> None:
        """Let people come and leave until a time."""
        nonlocal waiting, before
        while True:
            moment = min(time, coming[-1].arrival if coming else np.inf)
            if learners is not None:
                learners.record_departures([each for each in waiting if each.arrival + each.stay <= moment])
                learners.share.record_presence(len(waiting) + attended, moment - before)
            before = moment
            waiting = [each for each in waiting if each.arrival + each.stay > moment]
            if moment == time:
                return
            person = coming.pop()
            if len(waiting) + attended < room:
                waiting.append(person)

    while coming or waiting:
        advance(now, 0)
        candidates = [each.candidate for each in waiting if each.candidate.value > 0]
        if not candidates:
            if not coming:
                break
            now = np.nextafter(coming[-1].arrival, np.inf)
            continue
        if learners is not None:
            candidates = learners.add_hazards(candidates, people, now)
        person = find_person(people, choose(candidates))
        if learners is not None:
            learners.record_choice(person, now)
        waiting.remove(person)
        now += person.duration
        advance(now, 1)
        served[min(int(person.arrival // 3600), hours - 1)] += person.is_served
    return served


class Learners:
    """What the index learns: patience and q."""

    def __init__(self) -> None:
        self.patience, self.share = Patience(), ServedShare()

    def record_departures(self, people: list[Person]) -> None:
        for each in people:
            self.patience.observe(each.kind, each.stay, left=True, weight=each.candidate.probability)
            self.share.record(each.candidate.value, attended=False)

    def record_choice(self, person: Person, now: float) -> None:
        weight = person.candidate.probability
        self.patience.observe(person.kind, now - person.arrival, left=False, weight=weight)
        self.share.record(person.candidate.value, attended=True)

    def add_hazards(self, candidates: list[Candidate], people: list[Person], now: float) -> list[Candidate]:
        delay, hazard = find_delay([each.seconds for each in candidates]), self.patience.hazard
        return [
            replace(each, hazard=hazard(person.kind, now - person.arrival, delay))
            for each in candidates
            for person in [find_person(people, each.person)]
        ]


def compare(served: Array, base: Array) -> str:
    """Return the relative difference in %, and the half width of its interval."""
    width = 1.96 * (served - base).std(ddof=1) * len(base) ** 0.5
    return f"{served.sum() / base.sum() - 1:+.1%} ± {width / base.sum():.1%}"


def main(
    hours: Annotated[int, typer.Option(min=2)] = 60, seed: Annotated[int, typer.Option(min=0)] = 0
) -> None:
    """Print a row for each case."""
    domain = load_domain("intention")
    forecast = Forecast(domain, Planner(solve_domain(domain)))
    rows = [
        "| room | arrivals a minute | patience, s | shape | highest posterior, an hour | than by arrival |"
        " index, than highest posterior | q |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for room, rate, (name, means), shape in product(ROOMS, RATES, PATIENCE.items(), SHAPES):
        people = draw_people(forecast, np.random.default_rng(seed), hours, rate, means, shape)
        learners = Learners()

        def choose_by_index(near: list[Candidate], own: Learners = learners) -> object:
            return choose_candidate(near, share=own.share.share)

        first = simulate(people, lambda near: near[0].person, room, hours)
        base = simulate(people, lambda near: max(near, key=lambda each: each.probability).person, room, hours)
        index = simulate(people, choose_by_index, room, hours, learners)
        rows.append(
            f"| {room} | {rate:g} | {name} | {shape:g} | {base.sum() / hours:.0f} | {compare(base, first)} |"
            f" {compare(index, base)} | {learners.share.share:.2f} |"
        )
    Console().print("\n".join(rows), markup=False, soft_wrap=True)


if __name__ == "__main__":
    typer.run(main)
