"""Decisions about the people in a bag, as the robot would have made them: it watches, and nobody answers."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from pathlib import Path

from lcorpp.assembly.robot_parts import RobotParts
from lcorpp.decision import Strategy
from lcorpp.decision.dt_control import dt_control
from lcorpp.decision.strategies import Session
from lcorpp.domains import Domain
from lcorpp.errors import ActionFailedError, DataError, DomainError, LcorppError, PersonLeftError
from lcorpp.learning import TrainedClassifier
from lcorpp.robot.config import RobotConfig
from lcorpp.robot.facts import ClockFact, FixedFact, PlaceFact
from lcorpp.robot.loop import Decision, find_windows
from lcorpp.robot.tracking import PeopleTracks
from lcorpp.values import GAZE_CHANNELS, Instance, Step, wrap_angle
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
    for action in [name for name in domain.pomdp.actions if domain.reported_value(name) is None]:
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


class RecordedLoop:
    """A robot among the recorded people of a bag.

    Each person who is present is decided about once, as soon as the track is long enough, the first one
    first. A robot that stands at home sees the samples; those of the seconds that it watches are consumed by
    the decision.

    Args:
        config: of the robot; its connection, topics of beliefs and `[after]` are not used.
        parts: domain, policy and error rates. classifiers: sense -> its classifier.
        strategy: by which it decides. samples: of the people, of `read_samples`.
        show_step: takes the person and each step of a decision.

    Raises:
        DomainError: as `check_recordable`.
    """

    def __init__(
        self,
        config: RobotConfig,
        parts: RobotParts,
        classifiers: Mapping[str, TrainedClassifier],
        strategy: Strategy,
        samples: Sequence[Sample],
        *,
        show_step: Callable[[str, Step], None] = lambda person, step: None,
    ) -> None:
        check_recordable(config, parts.domain)
        self._config, self._parts, self._strategy, self._show_step = config, parts, strategy, show_step
        self._samples = sorted(samples, key=lambda sample: sample.time)
        self._place = 0
        windows = find_windows(parts.domain)
        silence = config.people.max_silence
        self._tracks = PeopleTracks(classifiers, max_silence=silence, windows=windows, is_live=False)
        self._full = replace(parts.robot, classifiers={})
        self._session: Session | None = None
        if strategy.start is not None:
            self._session = strategy.start(self._full, parts.rates)

    def run(self, max_decisions: int | None = None) -> Iterator[Decision]:
        """Decide about one person after another; yield each decision."""
        decided, count = set[str](), 0
        while count != max_decisions:
            present = self._tracks.list_people()
            decided &= present.keys()
            waiting = [
                name for name, seconds in present.items() if self._is_due(seconds) and name not in decided
            ]
            if waiting:
                decided.add(waiting[0])
                count += 1
                yield self._decide(waiting[0])
            elif not self._add_next():
                return

    def _is_due(self, seconds: float) -> bool:
        return seconds >= self._config.people.decide_after

    def _add_next(self) -> bool:
        """Add the next sample to the tracks; return whether there is one."""
        if self._place == len(self._samples):
            return False
        self._tracks.add([self._samples[self._place]])
        self._place += 1
        return True

    def _decide(self, person: str) -> Decision:
        facts, n_learnt = self._read_facts(), 0 if self._session is None else self._session.n_people
        full = replace(self._full, classifiers=self._tracks.classifiers(person))
        try:
            source = self._strategy if self._session is None else self._session
            robot = source.robot(full)
            episode = dt_control(
                robot,
                Instance(self._tracks.signals(person), facts),
                _RecordedWorld(self, person),
                max_steps=self._config.max_actions,
                listener=lambda step: self._show_step(person, step),
            )
            if self._session is not None:
                self._session.learn(episode.evidence, episode.steps)
        except LcorppError as error:
            return Decision(person, facts, None, error, n_learnt=n_learnt)
        return Decision(person, facts, episode, n_learnt=n_learnt)

    def _read_facts(self) -> dict[str, str]:
        """Return the facts that are fixed, or follow from the time of the recording."""
        facts = {}
        for name, fact in self._config.facts.items():
            if isinstance(fact, FixedFact):
                facts[name] = fact.value
            elif isinstance(fact, ClockFact):
                now = datetime.fromtimestamp(self._now)
                facts[name] = fact.at(now.hour + now.minute / 60)
            elif isinstance(fact, PlaceFact) and isinstance(self._config.pose, Pose):
                value = fact.at(self._config.pose.x, self._config.pose.y)
                if value is not None:
                    facts[name] = value
        return facts

    def watch(self, person: str, action: str) -> str:
        """Add the samples of some seconds of a person's track; return the observation.

        Raises:
            ActionFailedError: there is no label within the time-out of the action, by the samples' time.
            PersonLeftError: the recording ends before, or the person has left.
        """
        behaviour = self._config.behaviours[action]
        skill, began = behaviour.skill, self._now
        assert isinstance(skill, Watch)
        start = first = self._tracks.list_people().get(person, 0.0)
        while (seen := self._tracks.list_people().get(person)) is not None:
            start = min(start, seen)  # the track may have begun anew
            label = self._tracks.classify(person, skill.sense) if seen >= start + skill.seconds else None
            if isinstance(label, str) and label in skill.label_of:
                return skill.label_of[label]
            has_ended = not self._add_next()
            if has_ended or self._now - began > behaviour.timeout:
                watched = f"who was watched for {max(0.0, seen - first):.1f} s of {skill.seconds:g} s"
                what = f"{skill.sense} has no label of {person}, {watched}"
                if has_ended:
                    raise PersonLeftError(f"{what}, and the recording ends")
                if behaviour.failure is not None:
                    return behaviour.failure
                raise ActionFailedError(f"{what}, within {behaviour.timeout:g} s")
        raise PersonLeftError(f"the person {person} is no longer detected")

    @property
    def _now(self) -> float:
        """The time of the last sample that was added."""
        return self._samples[max(0, self._place - 1)].time


class _RecordedWorld:
    """A recorded person as the world of a decision (`lcorpp.protocols.World`)."""

    def __init__(self, loop: RecordedLoop, person: str) -> None:
        self._loop, self._person = loop, person

    def act(self, action: str) -> str:
        return self._loop.watch(self._person, action)

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
