"""Decisions about the people in a bag, as the robot would have made them: it watches, and nobody answers."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from datetime import datetime
from pathlib import Path

from lcorpp.assembly.robot_parts import RobotParts
from lcorpp.decision import Strategy
from lcorpp.domains import Domain
from lcorpp.errors import ActionFailedError, DataError, DomainError
from lcorpp.learning import TrainedClassifier
from lcorpp.robot.config import RobotConfig
from lcorpp.robot.deciding import Decider, Decision
from lcorpp.robot.facts import ClockFact, FixedFact, PlaceFact
from lcorpp.robot.tracking import PeopleTracks
from lcorpp.values import GAZE_CHANNELS, Step, wrap_angle
from lcorpp.worlds.ros.people.people_bag import read_people_bag
from lcorpp.worlds.ros.pose import Pose
from lcorpp.worlds.ros.sensor_messages import Sample
from lcorpp.worlds.ros.skills import Watch
from lcorpp.worlds.ros.transforms import TRANSFORMS


def check_recordable(config: RobotConfig, domain: Domain) -> None:
    """Check that a bag has all that the robot of a configuration perceives.

    Raises:
        DomainError: an action is not to watch, people are not from frames, a sense has a tracker of its own,
            or a fact is not known from a bag.
    """
    for action in [name for name in domain.model.actions if domain.reported_value(name) is None]:
        if not isinstance(config.behaviours[action].skill, Watch):
            raise DomainError(
                f"{config.file}: [actions.{action}] is not of the skill watch; a bag has no answers to others"
            )
    if config.people.senses:
        raise DomainError(f"{config.file}: [people.senses] has further trackers; a bag is read by one")
    if (kind := config.people.tracker.topic[1]) != TRANSFORMS:
        raise DomainError(f"{config.file}: people are from {kind}; a bag is read by frames, {TRANSFORMS}")
    for name, fact in config.facts.items():
        is_placed = isinstance(fact, PlaceFact) and isinstance(config.pose, Pose)
        if not isinstance(fact, FixedFact | ClockFact) and not is_placed:
            raise DomainError(
                f"{config.file}: [facts] {name} is not known from a bag; expected a fixed value, hours, or"
                " areas with a fixed pose"
            )


class RecordedPeople(PeopleTracks):
    """The people of a recording up to a sample, with the classifiers of their senses.

    Args:
        samples: of the people, of `read_samples`. classifiers: sense -> its classifier.
        max_silence, windows: as of `PeopleTracks`.
    """

    def __init__(
        self,
        samples: Sequence[Sample],
        classifiers: Mapping[str, TrainedClassifier],
        *,
        max_silence: float,
        windows: Mapping[str, float],
    ) -> None:
        self._rest = iter(sorted(samples, key=lambda sample: sample.time))
        super().__init__(classifiers, max_silence=max_silence, windows=windows, is_live=False)
        self.now = 0.0

    def wait(self) -> bool:
        """Add the next sample to the tracks; return whether there is one."""
        sample = next(self._rest, None)
        if sample is None:
            return False
        self.add([sample])
        self.now = sample.time
        return True


class RecordedLoop:
    """A robot among the recorded people of a bag.

    Each person who is present is decided about once, as soon as the track is long enough, the first one
    first. A robot that stands at home sees the samples; those of the seconds that it watches are consumed by
    the decision.

    Args:
        config: of the robot; its connection, topics of beliefs and `[after]` are not used.
        parts: domain, policy and error rates. people: of the recording.
        strategy: by which it decides. show_step: takes the person and each step of a decision.
        seed: as of `Decider`.

    Raises:
        DomainError: as `check_recordable`.
    """

    def __init__(
        self,
        config: RobotConfig,
        parts: RobotParts,
        strategy: Strategy,
        people: RecordedPeople,
        *,
        show_step: Callable[[str, Step], None] = lambda person, step: None,
        seed: int = 0,
    ) -> None:
        check_recordable(config, parts.domain)
        self._config, self._people, self._show_step = config, people, show_step
        self._decider = Decider(config, parts, strategy, people, seed=seed)

    def run(self, max_decisions: int | None = None) -> Iterator[Decision]:
        """Decide about one person after another; yield each decision."""
        decided, count, waited_from = set[str](), 0, self._config.people.decide_after
        while count != max_decisions:
            present = self._people.list_people()
            decided &= present.keys()
            waiting = [name for name, seconds in present.items() if seconds >= waited_from]
            person = next((name for name in waiting if name not in decided), None)
            if person is not None:
                decided.add(person)
                count += 1
                yield self._decide(person)
            elif not self._people.wait():
                return

    def _decide(self, person: str) -> Decision:
        world = _RecordedWorld(self._people, person, self._config)
        return self._decider.decide(
            person, self._read_facts, world, lambda step: self._show_step(person, step)
        )

    def _read_facts(self) -> dict[str, str]:
        """Return the facts that are fixed, or follow from the time of the recording."""
        now, pose = datetime.fromtimestamp(self._people.now), self._config.pose
        facts = dict[str, str | None]()
        for name, fact in self._config.facts.items():
            if isinstance(fact, ClockFact):
                facts[name] = fact.at(now.hour + now.minute / 60)
            elif isinstance(fact, PlaceFact) and isinstance(pose, Pose):
                facts[name] = fact.at(pose.x, pose.y)
            else:
                facts[name] = fact.read()
        return {name: value for name, value in facts.items() if value is not None}


class _RecordedWorld:
    """A recorded person as the world of a decision (`lcorpp.protocols.World`)."""

    def __init__(self, people: RecordedPeople, person: str, config: RobotConfig) -> None:
        self._people, self._person, self._behaviours = people, person, config.behaviours

    def act(self, action: str) -> str:
        """Watch the person; return the observation, also that of a failure if the behaviour has one."""
        behaviour = self._behaviours[action]
        assert isinstance(behaviour.skill, Watch)
        try:
            return behaviour.skill.observe(self._people, self._person, behaviour.timeout)
        except ActionFailedError:
            if behaviour.failure is None:
                raise
            return behaviour.failure

    def report(self, action: str) -> None:
        """Do nothing: what was recorded does not react."""


def read_samples(config: RobotConfig, bag: Path) -> list[Sample]:
    """Return the samples of the people in a bag, as the robot's classifiers get them.

    Raises:
        FileError, DataError: as `read_people_bag`.
    """
    tracker, heading = config.people.tracker, config.frames.training_heading
    found = read_people_bag(bag, tracker.topic[0], frame=config.frames.robot, head=tracker.head_frame)
    if not any(GAZE_CHANNELS[0] in sample.columns for sample in found) and tracker.head_frame is not None:
        raise DataError(f"{bag}: no face is connected to the head_frame {tracker.head_frame!r}")
    home, samples = Pose(0.0, 0.0, 0.0), list[Sample]()
    for sample in found:
        x, y = home.relate(sample.x, sample.y, heading)
        columns = dict(sample.columns)
        if "facing" in columns:
            columns["facing"] = float(wrap_angle(columns["facing"] + heading))
        samples.append(sample._replace(x=x, y=y, columns=columns))
    return samples
