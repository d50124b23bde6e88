"""A robot that attends to one of several people in the corridor, by one of four rules; for attention.py.

P(interested) comes from what the robot sees: positions -> streaming classifier -> P-log -> marginal. The
truth is used for the score alone.
"""

from __future__ import annotations

import math
import sys
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from lcorpp import Distribution, Domain, Planner, Reasoner
from lcorpp.decision.attention import Candidate, ServedShare, choose_candidate, find_delay
from lcorpp.decision.patience import Patience
from lcorpp.learning import StreamingClassifier
from lcorpp.simulation import Population

sys.path.insert(0, str(Path(__file__).parents[2] / "examples" / "robot"))

from corridor import HEARING_DISTANCE, MAX_SPEED, Corridor
from forecast import Forecast
from training import STEP, TRACK_SAMPLES
from walkers import DOORS, Patience as TruePatience, Visitor, draw_visitors

RULES = ("arrival", "posterior", "rate", "index")
PERIOD = 0.5
"""Seconds between two looks of an idle robot at the people."""
BATCH = 8
"""Samples that are classified together, for speed: those of about half a second."""
MAX_STANDING_SPEED = 0.3
"""Slower people stand: they wait. Those who walk past tell nothing of patience."""
NEAREST, MAX_DRIVE = 0.9, 5.0
"""The robot does not come closer to a person than this; the seconds that it drives to one at most."""


@dataclass(frozen=True)
class Scenario:
    """What is simulated. service: seconds in which the robot serves a person whose interest it reported."""

    name: str
    patience: Mapping[str, TruePatience]
    per_minute: float
    max_people: int
    service: float


@dataclass(eq=False)
class Learners:
    """What the rule "index" learns, from hour to hour."""

    patience: Patience = field(default_factory=Patience)
    served: ServedShare = field(default_factory=ServedShare)


@dataclass(eq=False)
class SeenPerson:
    """What the robot knows of a person.

    since: time at which they came near. stood: time at which they last stood there, None if they never did.
    value: of attending to them.
    """

    location: str
    kind: str
    place: tuple[float, float]
    since: float | None = None
    stood: float | None = None
    samples: int = 0
    posterior: tuple[int, float] | None = None
    value: float = 0.0
    is_decided: bool = False


class AttentiveRobot:
    """The robot of one hour. rule: of `RULES`; `time_of_day`: a fact that the robot knows."""

    def __init__(
        self,
        corridor: Corridor,
        domain: Domain,
        parts: tuple[StreamingClassifier, Reasoner, Planner, Forecast],
        scenario: Scenario,
        rule: str,
        time_of_day: str,
        learners: Learners,
    ) -> None:
        self._corridor, self._domain, self._scenario, self._rule = corridor, domain, scenario, rule
        self._streams, self._reasoner, self._planner, self._forecast = parts
        self._time_of_day, self._learners = time_of_day, learners
        self._seen = dict[int, SeenPerson]()
        self._samples = list[tuple[float, int, float, float]]()
        self.attended, self.present = 0, 0

    def run(self, seconds: float) -> Counter[str]:
        """Run for some time; return how the visits of interested people ended."""
        behaviour = self._behave()
        while self._corridor.time < seconds:
            self._corridor.step()
            self._watch()
            self.present += len(self._corridor.people)
            self._learners.served.record_presence(len(self._corridor.people), STEP)
            next(behaviour)
        return Counter(each.end for each in self._corridor.outcomes if each.visitor.is_interested)

    def _watch(self) -> None:
        """Classify the people in view, and notice who comes near and who leaves."""
        now, present = self._corridor.time, set[int]()
        x, y, _ = self._corridor.pose
        for person, at_x, at_y in self._corridor.people:
            present.add(person)
            seen = self._seen.get(person)
            if seen is None:
                location = min(DOORS, key=lambda name: abs(DOORS[name] - at_x))
                seen = self._seen[person] = SeenPerson(location, self._corridor.kinds[person], (at_x, at_y))
            if seen.samples < TRACK_SAMPLES:
                seen.samples += 1
                self._samples.append((now, person, at_x, at_y))
            is_near = math.hypot(at_x - x, at_y - y) < HEARING_DISTANCE
            if is_near and math.dist((at_x, at_y), seen.place) < MAX_STANDING_SPEED * STEP:
                seen.stood = now
            seen.place = at_x, at_y
            if is_near and seen.since is None:
                seen.since = now
            elif not is_near and seen.since is not None and math.hypot(at_x, at_y) > HEARING_DISTANCE + 1:
                self._end_stay(person, left=True)
                seen.is_decided = True
        if len(self._samples) >= BATCH:
            self._streams.push_many(self._samples)
            self._samples = []
        for person in [person for person in self._seen if person not in present]:
            self._forget(person, left=True)

    def _forget(self, person: int, *, left: bool) -> None:
        self._end_stay(person, left=left)
        del self._seen[person]
        if person in self._streams.predictions:
            self._streams.remove(person)

    def _end_stay(self, person: int, *, left: bool) -> None:
        """Learn from a stay that ended: the person left, or the robot attends to them."""
        seen = self._seen[person]
        if seen.since is None or seen.is_decided:
            return
        probability = self._infer(person)
        if probability is not None and seen.stood is not None:
            waited = (seen.stood if left else self._corridor.time) - seen.since
            self._learners.patience.observe(seen.kind, waited, left=left, weight=probability)
        self._learners.served.record(seen.value, attended=not left)

    def _infer(self, person: int) -> float | None:
        """Return P(interested) from the facts and the track so far; None with too few samples."""
        seen, prediction = self._seen[person], self._streams.predictions.get(person)
        if prediction is None or prediction.probabilities is None:
            return None
        if seen.posterior is None or seen.posterior[0] != prediction.points:
            label = self._streams.classifier(person).soft().classify(np.zeros((2, 2)))
            facts = {"time": self._time_of_day, "location": seen.location}
            evidence = self._domain.evidence(facts, {"motion": label})
            marginal = self._reasoner.posterior(self._domain.shared, evidence)
            seen.posterior = prediction.points, marginal["interested"]
        return seen.posterior[1]

    def _list_candidates(self) -> list[Candidate]:
        """Return the people near the robot about whom it has not decided, in the order of arrival."""
        near = [
            (seen.since, person)
            for person, seen in self._seen.items()
            if seen.since is not None and not seen.is_decided
        ]
        found = dict[int, Candidate]()
        for _, person in sorted(near):
            probability = self._infer(person)
            if probability is not None:
                value, seconds = self._forecast.of(round(100 * probability), self._scenario.service)
                seconds += self._forecast_drive(person)
                self._seen[person].value = value
                found[person] = Candidate(person, probability, value, seconds, 0.0)
        worthwhile = {person: each for person, each in found.items() if each.value > 0}
        if not worthwhile:
            return []
        delay = find_delay([each.seconds for each in worthwhile.values()])
        return [
            replace(each, hazard=self._estimate_hazard(person, delay)) for person, each in worthwhile.items()
        ]

    def _estimate_hazard(self, person: int, ahead: float) -> float:
        seen = self._seen[person]
        assert seen.since is not None
        return self._learners.patience.hazard(seen.kind, self._corridor.time - seen.since, ahead)

    def _choose(self, candidates: list[Candidate]) -> int:
        if self._rule == "arrival":
            person = candidates[0].person
        elif self._rule == "posterior":
            person = max(candidates, key=lambda each: each.probability).person
        else:
            share = self._learners.served.share if self._rule == "index" else 0.0
            person = choose_candidate(candidates, share=share)
        assert isinstance(person, int)
        return person

    def _behave(self) -> Iterator[None]:
        """The robot's behaviour: each step of the generator is one of the simulation."""
        while True:
            candidates = self._list_candidates()
            if not candidates:
                yield from self._wait(PERIOD)
                continue
            person = self._choose(candidates)
            self._end_stay(person, left=False)
            self._seen[person].is_decided = True
            self.attended += 1
            probability = self._infer(person)
            assert probability is not None
            yield from self._decide(person, probability)
            self._corridor.navigate(0.0, 0.0, math.pi / 2)

    def _decide(self, person: int, probability: float) -> Iterator[None]:
        domain, corridor = self._domain, self._corridor
        yield from self._drive_to(person)
        belief = domain.prior(Distribution(domain.values, np.array([probability, 1 - probability])))
        while True:
            action = self._planner.action(belief)
            value = domain.reported_value(action)
            if value is not None:
                assert isinstance(value, str)
                yield from self._wait(STEP)
                if not corridor.can_hear(person):
                    corridor.release(person)
                elif corridor.report(person, value):
                    yield from self._wait(self._scenario.service)
                return
            yield from self._act(person, action)
            if not corridor.can_hear(person):
                corridor.release(person)
                return
            belief = self._planner.update(belief, action, corridor.answer(person, action))

    def _drive_to(self, person: int) -> Iterator[None]:
        """Drive up to a person, as far as the way is free."""
        corridor = self._corridor
        for _ in range(round(MAX_DRIVE / STEP)):
            place = self._find_place(person)
            if place is None:
                return
            x, y, _ = corridor.pose
            distance = math.dist(place, (x, y))
            if distance < NEAREST + 0.3 or corridor.goal_state == "aborted":
                break
            share = (distance - NEAREST) / distance
            corridor.navigate(x + share * (place[0] - x), y + share * (place[1] - y))
            yield
        corridor.cancel()

    def _forecast_drive(self, person: int) -> float:
        """Return the seconds that the robot drives to a person."""
        place, (x, y, _) = self._find_place(person), self._corridor.pose
        return 0.0 if place is None else STEP + max(math.dist(place, (x, y)) - NEAREST, 0.0) / MAX_SPEED

    def _find_place(self, person: int) -> tuple[float, float] | None:
        return next(((x, y) for each, x, y in self._corridor.people if each == person), None)

    def _act(self, person: int, action: str) -> Iterator[None]:
        """Move as the action does; it takes the seconds that the model states as its cost."""
        corridor, pomdp = self._corridor, self._domain.pomdp
        seconds = -float(pomdp.reward[pomdp.action_index(action), 0])
        place = self._find_place(person)
        if place is not None and action != "greet":
            x, y, _ = corridor.pose
            bearing = math.atan2(place[1] - y, place[0] - x)
            if action == "turn":
                corridor.navigate(x, y, bearing)
            else:
                ahead = min(0.5, max(math.hypot(place[0] - x, place[1] - y) - NEAREST, 0.0))
                corridor.navigate(x + ahead * math.cos(bearing), y + ahead * math.sin(bearing))
        yield from self._wait(seconds)
        if action != "greet":
            corridor.cancel()

    def _wait(self, seconds: float) -> Iterator[None]:
        for _ in range(max(round(seconds / STEP), 1)):
            yield


def run_hour(
    domain: Domain,
    parts: tuple[StreamingClassifier, Reasoner, Planner, Forecast],
    scenario: Scenario,
    rule: str,
    hour: int,
    seed: int,
    learners: Learners,
) -> dict[str, float]:
    """Simulate an hour; return the number of visits of interested people, and how they ended."""
    time_of_day = ("morning", "afternoon", "evening")[hour % 3]
    rng = np.random.default_rng([seed, 2, hour])
    visitors: list[Visitor] = draw_visitors(
        Population(domain), rng, seconds=3600, per_minute=scenario.per_minute,
        patience=scenario.patience, time=time_of_day,
    )  # fmt: skip
    corridor = Corridor(visitors, domain, max_people=scenario.max_people, step=STEP, seed=hour)
    robot = AttentiveRobot(corridor, domain, parts, scenario, rule, time_of_day, learners)
    ends = robot.run(3600)
    interested = sum(visitor.is_interested for visitor in visitors)
    return {
        "interested": interested,
        "attended": robot.attended,
        "present": round(robot.present * STEP / 3600, 2),
        **ends,
    }
