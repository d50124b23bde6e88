"""Logs of simulated people for tests."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from itertools import product
from pathlib import Path

import numpy as np

from lcorpp.assembly import RobotParts, solve_domain
from lcorpp.assembly.robot_parts import ClassifierPart
from lcorpp.domains import Domain, load_domain
from lcorpp.logs.decision_log import FORMAT
from lcorpp.planning.policy_cache import find_cache_folder
from lcorpp.scoring.cases import compute_joint_distribution

NOISE = 0.3
ATTRIBUTES = ("time", "location", "identity", "intention")
Observed = tuple[dict[str, str], str, tuple[str, ...]]
"""A person's values, label and answers."""


def write_log(
    path: Path,
    preset: str,
    n: int,
    seed: int,
    *,
    asked: int = 3,
    extra: Mapping[str, int] = {},
    soft: bool = False,
) -> Domain:
    """Write a log of people who answer some questions each, with the noise of the domain's simulation.

    People are a systematic sample, in which each combination of values is about as frequent as expected, so
    that nothing is refuted by chance.

    Args:
        asked: answers of each person. extra: attribute -> one person in so many has it as a fact, too.
        soft: whether labels are likelihoods.
    """
    domain = load_domain("intention", preset=preset)
    policy = solve_domain(domain, cache=find_cache_folder()).policy
    parts = RobotParts(domain, policy, {"motion": ClassifierPart("channel", soft=soft)})
    kinds, probabilities = zip(*_list_people(domain, asked), strict=True)
    ends = np.floor(np.cumsum([0, *probabilities]) * n + np.random.default_rng(seed).random())
    people: list[Observed] = [
        kind for kind, k in zip(kinds, np.diff(ends), strict=True) for _ in range(int(k))
    ]
    with path.open("w") as file:
        for i, (person, label, answers) in enumerate(people):
            facts = {name: person[name] for name in domain.observed}
            facts |= {name: person[name] for name, every in extra.items() if i % every == 0}
            given = {name: 1.0 if name == label else 0.4 for name in ("one", "zero")} if soft else label
            steps = [{"action": "greet", "observation": o, "belief": {}} for o in answers]
            line = {
                **FORMAT.header,
                "strategy": {"name": "LCORPP"},
                "facts": facts,
                "evidence": {**facts, "classifier": given},
                "steps": steps,
                "parts": parts.description,
            }
            file.write(json.dumps(line) + "\n")
    return domain


def _list_people(domain: Domain, asked: int) -> Iterator[tuple[Observed, float]]:
    """Yield what may be observed of a person, with its probability."""
    joint = compute_joint_distribution(domain, ATTRIBUTES)
    for values, label, answers in product(joint, ("one", "zero"), product(("pos", "neg"), repeat=asked)):
        interested = values[-1] == "interested"
        one = 0.76 if interested else 0.29
        right = answers.count("pos" if interested else "neg")
        p = (
            joint[values]
            * (one if label == "one" else 1 - one)
            * (1 - NOISE) ** right
            * NOISE ** (asked - right)
        )
        yield (dict(zip(ATTRIBUTES, values, strict=True)), label, answers), p
