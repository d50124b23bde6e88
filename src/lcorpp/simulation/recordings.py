"""Recordings of simulated people, in the form in which a tracker writes them."""

from __future__ import annotations

import numpy as np

from lcorpp.domains import Domain
from lcorpp.domains.sections.learning import Sense
from lcorpp.errors import DomainError
from lcorpp.learning.data.tracks import COLUMNS, Recording, Track
from lcorpp.reasoning import Reasoner
from lcorpp.simulation.people import Person, Population

PAPER_TRACKS, PAPER_POSITIVES = 2286, 63
"""The number of tracks in the paper's data set, and of those with the positive label."""


def simulate_recording(
    domain: Domain,
    rng: np.random.Generator,
    *,
    tracks: int = PAPER_TRACKS,
    positives: int | None = None,
    seconds: tuple[float, float] | None = None,
) -> Recording:
    """Simulate one recorded track per person, in random order.

    Args:
        rng: draws the people and their tracks.
        tracks: the number of tracks.
        positives: the number of tracks of the domain's positive class; None takes the paper's share, 63 of
            2286, and at least one. The other classes are drawn from the simulation program.
        seconds: the shortest and the longest duration, the same range for all classes; None takes the
            domain's durations.

    Raises:
        DomainError: the domain has no `people.py` with recordings or no positive class, or its `people.py`
            fails.

    Examples:
        >>> import numpy as np
        >>> from lcorpp import load_domain
        >>> from lcorpp.simulation import simulate_recording
        >>> recording = simulate_recording(load_domain("intention"), np.random.default_rng(0), tracks=5)
        >>> sorted(track.label for track in recording.tracks)
        ['interested', 'not_interested', 'not_interested', 'not_interested', 'not_interested']
    """
    if domain.simulation.recordings is None:
        raise DomainError(f"{domain.folder}: no people.py with recordings to simulate a recording with")
    if positives is None:
        positives = max(1, round(tracks * PAPER_POSITIVES / PAPER_TRACKS))
    sense = find_recorded_sense(domain)
    people = _sample_people(domain, sense, tracks, positives, rng)
    options = {} if seconds is None else {"seconds": seconds}
    simulated = list[Track]()
    for person, array in zip(people, domain.simulation.recordings(people, rng, **options), strict=True):
        table = dict(zip(domain.simulation.columns, array.T, strict=True))
        columns = {name: table[name] for name in COLUMNS if name in table}
        simulated.append(Track(str(len(simulated) + 1), table["time"], columns, person[sense.of]))
    source = f"{tracks} simulated tracks ({domain.folder.name}/people.py)"
    return Recording(tuple(simulated), source=source)


def find_recorded_sense(domain: Domain) -> Sense:
    """Return the sense that a recording is for: the first, which classifies motion."""
    if not domain.senses:
        raise DomainError(f"{domain.folder}/domain.toml: no [learning], so there is nothing to record")
    return domain.senses[0]


def _sample_people(
    domain: Domain, sense: Sense, tracks: int, positives: int, rng: np.random.Generator
) -> list[Person]:
    """Draw `positives` people of the positive class and the rest of the other classes, in random order."""
    if sense.positive is None:
        raise DomainError(
            f"{domain.folder}/domain.toml: [learning] positive is missing; a recording needs the rare class"
        )
    if not 0 <= positives <= tracks:
        raise DomainError(f"{positives} of {tracks} tracks cannot be positive")
    shares = dict(Reasoner(domain.simulation.true_program).posterior(sense.of, {}))
    others = [value for value in sense.classes if value != sense.positive]
    weights = np.array([shares[value] for value in others])
    counts = rng.multinomial(tracks - positives, weights / weights.sum())
    count_of = {sense.positive: positives, **dict(zip(others, counts.tolist(), strict=True))}
    population = Population(domain)
    people = [
        person
        for value, count in count_of.items()
        for person in population.sample(count, rng, {sense.of: value})
    ]
    return [people[i] for i in rng.permutation(len(people))]
