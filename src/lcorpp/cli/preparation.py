"""What `run`, `explain` and `learn` do before the first decision: the robot and its policy."""

from __future__ import annotations

from pathlib import Path

from lcorpp import planning
from lcorpp.cli import console as show, model_files as models
from lcorpp.cli.eyes import Eyes
from lcorpp.decision import Robot
from lcorpp.domains import Domain
from lcorpp.reasoning import Reasoner


def introduce(domain: Domain) -> None:
    """Say which domain this is."""
    preset = f", preset {domain.preset}" if domain.preset else ""
    show.console.print(f"{domain.name}{preset}: {domain.description}", style="bold")


def robot(domain: Domain, looking: Eyes, policy: Path | None = None) -> Robot:
    """The full robot: the classifier, the reasoner with its rules, and the policy, solved or read."""
    return Robot(looking.reader, Reasoner(looking.program), planner(domain, policy), domain)


def planner(domain: Domain, policy: Path | None = None) -> planning.Planner:
    """The policy of a domain's model: read from a file, else solved."""
    pomdp = domain.pomdp
    if policy is not None:
        return planning.Planner(models.read_policy(policy, pomdp), pomdp)
    starts = domain.start_beliefs()
    with show.progress("solving the POMDP"):
        solution = planning.solve(pomdp, starts)
    lower, gap = solution.policy.value(pomdp.start), solution.gap(pomdp.start)
    show.console.print(
        f"SARSOP: {lower:.3f} to {lower + gap:.3f} at the model's start; {solution.vectors} vectors for"
        f" {len(starts)} priors, {solution.seconds:.1f} s"
    )
    return planning.Planner(solution)
