"""Recordings of simulated people: what a tracker would have written, to learn from and to share."""

from __future__ import annotations

import numpy as np

from lcorpp.domains import Domain
from lcorpp.errors import DomainError
from lcorpp.learning.data.tracks import COLUMNS, Recording, Track
from lcorpp.reasoning import Reasoner
from lcorpp.simulation.population import Person, Population

PAPER_TRACKS, PAPER_POSITIVES = 2286, 63
"""Tracks in the paper's data set, and those of people who wanted to interact."""


def simulated_recording(
    domain: Domain,
    rng: np.random.Generator,
    *,
    tracks: int = PAPER_TRACKS,
    positives: int | None = None,
    seconds: tuple[float, float] | None = None,
) -> Recording:
    """People of a domain, recorded one by one, shuffled; every track is of another person.

    Args:
        tracks: how many in all.
        positives: how many of the domain's positive class; None takes the paper's share, 63 of 2286, and at
            least one. The others are drawn as the truth program has them.
        seconds: the shortest and the longest duration, alike for all; None leaves it to the domain.

    Raises:
        DomainError: the domain has no `people.py` with recordings or no positive class, or its `people.py`
            fails.
    """
    if domain.simulation.recordings is None:
        raise DomainError(f"{domain.folder}: no people.py with recordings; nothing can be made of it")
    if positives is None:
        positives = max(1, round(tracks * PAPER_POSITIVES / PAPER_TRACKS))
    people = _people(domain, tracks, positives, rng)
    options = {} if seconds is None else {"seconds": seconds}
    arrays = domain.simulation.recordings(people, rng, **options)
    columns = domain.simulation.columns
    named = [dict(zip(columns, array.T, strict=True)) for array in arrays]
    return Recording(
        tuple(
            Track(
                str(number),
                columns["time"],
                {name: columns[name] for name in COLUMNS if name in columns},
                person[domain.target],
            )
            for number, (person, columns) in enumerate(zip(people, named, strict=True), start=1)
        ),
        source=f"{tracks} simulated tracks ({domain.folder.name}/people.py)",
    )


def _people(domain: Domain, tracks: int, positives: int, rng: np.random.Generator) -> list[Person]:
    """So many people of the positive class and others, in random order."""
    if domain.positive is None:
        raise DomainError(f"{domain.folder}/domain.toml: [learning] positive is missing; who is to be rare?")
    if not 0 <= positives <= tracks:
        raise DomainError(f"{positives} of {tracks} tracks cannot be positive")
    shares = dict(Reasoner(domain.simulation.truth).posterior(domain.target, {}))
    others = [value for value in domain.values if value != domain.positive]
    weights = np.array([shares[value] for value in others])
    counts = rng.multinomial(tracks - positives, weights / weights.sum())
    wanted = {domain.positive: positives, **dict(zip(others, counts.tolist(), strict=True))}
    population = Population(domain)
    people = [
        person
        for value, count in wanted.items()
        for person in population.people(count, rng, {domain.target: value})
    ]
    return [people[i] for i in rng.permutation(len(people))]
