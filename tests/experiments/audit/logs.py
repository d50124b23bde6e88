"""Logs of simulated people for tests."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from lcorpp.domains import Domain, load_domain
from lcorpp.experiments import RobotParts, solve_domain
from lcorpp.experiments.decision_log import FORMAT, VERSION
from lcorpp.experiments.robot_parts import ClassifierPart
from lcorpp.simulation.people import Population

NOISE = 0.3


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

    Args:
        asked: answers of each person. extra: attribute -> one person in so many has it as a fact, too.
        soft: whether labels are likelihoods.
    """
    domain = load_domain("intention", preset=preset)
    policy = solve_domain(domain).policy
    parts = RobotParts(domain, policy, {"motion": ClassifierPart("channel", soft=soft)})
    rng = np.random.default_rng(seed)
    with path.open("w") as file:
        for i, person in enumerate(Population(domain).sample(n, rng)):
            interested = person["intention"] == "interested"
            facts = {name: person[name] for name in domain.observed}
            facts |= {name: person[name] for name, every in extra.items() if i % every == 0}
            label = "one" if rng.random() < (0.76 if interested else 0.29) else "zero"
            given = {name: 1.0 if name == label else 0.4 for name in ("one", "zero")} if soft else label
            answers = ["pos" if (rng.random() < NOISE) != interested else "neg" for _ in range(asked)]
            steps = [{"action": "greet", "observation": o, "belief": {}} for o in answers]
            line = {
                "format": FORMAT,
                "version": VERSION,
                "strategy": {"name": "LCORPP"},
                "facts": facts,
                "evidence": {**facts, "classifier": given},
                "steps": steps,
                "parts": parts.description,
            }
            file.write(json.dumps(line) + "\n")
    return domain
