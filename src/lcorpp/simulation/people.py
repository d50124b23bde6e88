"""Simulated people, drawn from a domain's P-log program, and what the robot's sensors record of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from lcorpp.domains import Domain
from lcorpp.domains.sections.learning import Sense
from lcorpp.errors import DataError, DomainError
from lcorpp.reasoning import Reasoner
from lcorpp.values import (
    Array,
    Dataset,
    count_window,
    cut_tracks,
    find_perceived,
    stack_signals,
    strip_padding,
)

Person = Mapping[str, str]
"""One person: every attribute of the simulation's program and its value."""


class Population:
    """People drawn from a domain's simulation program (section "Experimental Results" of the paper).

    The program's rules order the draw, e.g. identity, then time and location, then intention.

    Examples:
        >>> import numpy as np
        >>> from lcorpp import load_domain
        >>> from lcorpp.simulation import Population
        >>> population, rng = Population(load_domain("intention")), np.random.default_rng(0)
        >>> people = population.sample(2, rng, {"time": "evening"})
        >>> [person["time"] for person in people]
        ['evening', 'evening']
    """

    def __init__(self, domain: Domain) -> None:
        self._reasoner = Reasoner(domain.simulation.true_program)

    def sample(self, count: int, rng: np.random.Generator, given: Mapping[str, str] = {}) -> list[Person]:
        """Draw `count` people from the distribution conditioned on the values in `given`.

        Raises:
            UndefinedError: no possible world has these values.
        """
        return list(self._reasoner.sample_many(count, rng, given))


class SignalSource(Protocol):
    """A source of the signals of one sense, one for each person."""

    def simulate(self, people: Sequence[Person], rng: np.random.Generator) -> Array:
        """Return an array (people, channels, time points) or (people, features).

        All numbers of a person whom the sense does not perceive are NaN.
        """


@dataclass(frozen=True, eq=False)
class SimulatedSignals:
    """Signals from a function of a domain's `people.py`.

    Examples:
        >>> import numpy as np
        >>> from lcorpp import load_domain
        >>> from lcorpp.simulation import Population, SimulatedSignals
        >>> domain, rng = load_domain("intention"), np.random.default_rng(0)
        >>> people = Population(domain).sample(3, rng)
        >>> SimulatedSignals.from_domain(domain, domain.senses[0]).simulate(people, rng).shape[:2]
        (3, 2)
    """

    function: Callable[[Sequence[Person], np.random.Generator], Array]

    @classmethod
    def from_domain(cls, domain: Domain, sense: Sense) -> SimulatedSignals:
        """Return the source of a sense.

        Raises:
            DomainError: the domain has no `people.py` with a function for the sense.
        """
        if sense.name not in domain.simulation.signals:
            raise DomainError(
                f"{domain.folder}: no people.py with a function {sense.name!r} or 'trajectories'; give"
                " --data, or --classifier channel to `lcorpp run`"
            )
        return cls(domain.simulation.signals[sense.name])

    def simulate(self, people: Sequence[Person], rng: np.random.Generator) -> Array:
        return self.function(people, rng)


@dataclass(frozen=True, eq=False)
class RecordedSignals:
    """Signals sampled from a recorded `dataset`, e.g. a held-out test set.

    Each person gets a signal whose label equals the person's value of the attribute `of`.

    Examples:
        >>> import numpy as np
        >>> from lcorpp import Dataset
        >>> from lcorpp.simulation import RecordedSignals
        >>> walks = Dataset([[[0, 1], [0, 0]], [[3, 3], [1, 1]]], ("passing", "waiting"))
        >>> signals = RecordedSignals("intention", walks)
        >>> signals.simulate([{"intention": "waiting"}], np.random.default_rng(0)).tolist()
        [[[3.0, 3.0], [1.0, 1.0]]]
    """

    of: str
    dataset: Dataset

    def simulate(self, people: Sequence[Person], rng: np.random.Generator) -> Array:
        labels, rows = np.array(self.dataset.labels), []
        for person in people:
            candidates = np.flatnonzero(labels == person[self.of])
            if not len(candidates):
                raise DataError(f"no recorded case of class {person[self.of]!r} is left for the trials")
            rows.append(int(rng.choice(candidates)))
        return self.dataset.trajectories[rows]


@dataclass(frozen=True, eq=False)
class CutSignals:
    """A part of the signals over time of another source, e.g. slice(-90, None), the last 90 time points."""

    source: SignalSource
    part: slice

    def simulate(self, people: Sequence[Person], rng: np.random.Generator) -> Array:
        signals = self.source.simulate(people, rng)
        if signals.ndim == 2:
            raise DataError("features have no duration; expected no seconds to cut them to")
        return cut_tracks(signals, self.part)


@dataclass(frozen=True, eq=False)
class SelectedSignals:
    """Some channels of the signals of another source, by their indices."""

    source: SignalSource
    channels: Sequence[int]

    def simulate(self, people: Sequence[Person], rng: np.random.Generator) -> Array:
        return self.source.simulate(people, rng)[:, list(self.channels)]


def simulate_signals(
    domain: Domain, sense: str, source: SignalSource, people: Sequence[Person], rng: np.random.Generator
) -> Array:
    """Simulate what a sense perceives of people, with NaN for those whom it does not perceive.

    Those are the people of whom the source has no signal, and those whom `[simulation.present]` draws.

    Examples:
        >>> import numpy as np
        >>> from lcorpp import load_domain
        >>> from lcorpp.simulation import NoisyChannel, simulate_signals
        >>> half = {"simulation": {"present": {"motion": 0.5}}}
        >>> domain, rng = load_domain("intention", changes=half), np.random.default_rng(1)
        >>> people = [{"intention": "interested"}] * 4
        >>> channel = NoisyChannel.from_domain(domain, domain.senses[0])
        >>> simulate_signals(domain, "motion", channel, people, rng).ravel().tolist()
        [0.0, 1.0, nan, 1.0]
    """
    signals, presence = source.simulate(people, rng), domain.simulation.presence.get(sense)
    if presence is None:
        return signals
    absent = rng.random(len(people)) >= [presence.probability(person) for person in people]
    return np.where(absent.reshape(-1, *[1] * (signals.ndim - 1)), np.nan, signals)


def select_signals(signals: Mapping[str, Array], i: int) -> dict[str, Array]:
    """Return sense -> its signal of person i, for the senses that perceived that person.

    Args:
        signals: sense -> (people, ...), as of `simulate_signals`.
    """
    return {sense: own[i] for sense, own in signals.items() if find_perceived(own[i : i + 1])[0]}


MAX_REDRAWS = 100
"""Maximum number of people drawn for one case of a training set until the sense perceives one."""


def simulate_dataset(
    domain: Domain, sense: Sense, source: SignalSource, count: int, rng: np.random.Generator
) -> Dataset:
    """Simulate a balanced, shuffled training set of a sense.

    Args:
        source: of the signals. rng: draws the people and their signals.
        count: the number of cases, rounded up to a multiple of the number of classes; 0 for an empty set.

    Raises:
        DomainError: the signals have another number of channels than the sense names, or it perceives no one
            of a class.

    Examples:
        >>> import numpy as np
        >>> from lcorpp import load_domain
        >>> from lcorpp.simulation import SimulatedSignals, simulate_dataset
        >>> domain = load_domain("intention")
        >>> source = SimulatedSignals.from_domain(domain, domain.senses[0])
        >>> dataset = simulate_dataset(domain, domain.senses[0], source, 10, np.random.default_rng(0))
        >>> dataset.trajectories.shape, dataset.labels.count("interested")
        ((10, 2, 304), 5)
    """
    population = Population(domain)
    per_class = max(-(-count // len(sense.classes)), 1)  # of no cases the shape of signals is needed
    people = [
        person for value in sense.classes for person in population.sample(per_class, rng, {sense.of: value})
    ]
    people = [people[i] for i in rng.permutation(len(people))]
    labels = tuple(person[sense.of] for person in people)
    signals = _simulate_perceived(domain, sense, source, people, population, rng)
    try:
        dataset = Dataset(signals, labels, interval=sense.interval, channels=sense.channels)
    except DataError as error:
        raise DomainError(
            f"{domain.folder}: signals of {sense.name!r}: {error}; `channels` in [learning] names them"
        ) from None
    dataset = dataset if count else dataset.take([])
    return replace(
        dataset, source=f"{len(dataset)} simulated {dataset.unit} ({domain.folder.name}/people.py)"
    )


def _simulate_perceived(
    domain: Domain,
    sense: Sense,
    source: SignalSource,
    people: Sequence[Person],
    population: Population,
    rng: np.random.Generator,
) -> Array:
    """Simulate the signals of people; one whom the sense does not perceive is replaced by one of its class.

    Raises:
        DomainError: of some class no one is perceived.
    """
    signals = simulate_signals(domain, sense.name, source, people, rng)
    missing = np.flatnonzero(~find_perceived(signals)).tolist()
    rows = [strip_padding(row) for row in signals] if missing else []
    for _ in range(MAX_REDRAWS):
        if not missing:
            return stack_signals(rows) if rows else signals
        others = [population.sample(1, rng, {sense.of: people[i][sense.of]})[0] for i in missing]
        redrawn = simulate_signals(domain, sense.name, source, others, rng)
        perceived = find_perceived(redrawn)
        for i, row, known in zip(missing, redrawn, perceived, strict=True):
            if known:
                rows[i] = strip_padding(row)
        missing = [i for i, known in zip(missing, perceived, strict=True) if not known]
    raise DomainError(
        f"{domain.folder}: {sense.name!r} does not perceive one of {MAX_REDRAWS} people whose {sense.of} is"
        f" {people[missing[0]][sense.of]}, so there is nothing to train with; expected a signal of some"
    )


def make_signal_source(domain: Domain, sense: Sense, seconds: float | None) -> SignalSource:
    """Return the simulated signals of a sense, or their last seconds; None for all.

    Raises:
        DomainError: the domain has no `people.py` with a function for the sense.
        DataError: seconds are given, and the signals are features.
    """
    source = SimulatedSignals.from_domain(domain, sense)
    if seconds is None:
        return source
    return CutSignals(source, slice(-count_window(seconds, sense.interval), None))
