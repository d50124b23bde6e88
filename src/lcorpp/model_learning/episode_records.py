"""Records of episodes for the knowledge: their facts, and the likelihood of their steps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from lcorpp.errors import DataError, expected_one_of
from lcorpp.fitting import SoftRecord
from lcorpp.model_learning.baum_welch import expect
from lcorpp.model_learning.episodes import Episodes
from lcorpp.model_learning.spaces import Space
from lcorpp.model_learning.structure import Model
from lcorpp.reasoning import Program, Reasoner
from lcorpp.values import Array

MIN_LIKELIHOOD = 1e-9
"""Shared values that are less likely, relative to the most likely one, are left out of a record."""


def add_evidence(episodes: Episodes, space: Space) -> Episodes:
    """Return the episodes with the evidence of those facts that are shared variables.

    Raises:
        DataError: a fact is not a value of the variable.
    """
    names = [name for name in space.variables if any(name in facts for facts in episodes.facts)]
    evidence = np.ones((len(episodes), len(space)))
    for name in names:
        i = space.variables.index(name)
        own = np.array([value[i] for value in space.values])
        for n, facts in enumerate(episodes.facts):
            if name in facts:
                if facts[name] not in own:
                    place = getattr(facts, "place", f"episode {n + 1}")
                    found = expected_one_of(list(dict.fromkeys(own.tolist())))
                    raise DataError(f"{place}: {name} is {facts[name]}; {found}, as in the reports")
                evidence[n] *= own == facts[name]
    return replace(episodes, evidence=evidence) if names else episodes


def make_records(episodes: Episodes, space: Space, model: Model) -> list[SoftRecord]:
    """Return a record of each episode: its facts, with the likelihood of its shared values."""
    logs = compute_likelihoods(episodes, space, model)
    shares = np.exp(logs - logs.max(axis=1, keepdims=True))
    records = []
    for facts, own in zip(episodes.facts, shares, strict=True):
        others = {name: value for name, value in facts.items() if name not in space.variables}
        alternatives = [
            (dict(zip(space.variables, value, strict=True)), float(share))
            for value, share in zip(space.values, own, strict=True)
            if share >= MIN_LIKELIHOOD
        ]
        records.append(SoftRecord(others, tuple(alternatives)))
    return records


def compute_likelihoods(episodes: Episodes, space: Space, model: Model) -> Array:
    """Return (N, V) the log-likelihood of each episode and its evidence, given each shared value."""
    logs, values = np.zeros((len(episodes), len(space))), model.structure.values
    for v in range(len(space)):
        start = np.where(values == v, model.parameters.start, 0.0)
        given = replace(model.parameters, start=start / start.sum())
        logs[:, v] = expect(episodes, given, values).log_likelihoods
    return logs


def compute_posteriors(program: Program, facts: Sequence[Mapping[str, str]], space: Space) -> Array:
    """Return (n, V) P(shared value | facts) of people, by a program."""
    reasoner, found = Reasoner(program), dict[frozenset[tuple[str, str]], Array]()
    shared = space.variables[0] if len(space.variables) == 1 else space.variables
    names = [own[0] if len(own) == 1 else own for own in space.values]
    for own in facts:
        key = frozenset(own.items())
        if key not in found:
            posterior = reasoner.posterior(shared, own)
            found[key] = np.array([posterior[name] for name in names])
    return np.array([found[frozenset(own.items())] for own in facts])
