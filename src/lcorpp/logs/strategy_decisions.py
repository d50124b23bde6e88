"""The decisions of one strategy in a log."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lcorpp.assembly.logged_parts import load_logged_domain, read_program
from lcorpp.domains import Domain
from lcorpp.errors import DataError
from lcorpp.logs.decision_log import DAMAGE, LoggedDecision, describe_damage, read_log
from lcorpp.reasoning import Program


@dataclass(frozen=True, eq=False)
class StrategyDecisions:
    """The decisions of one strategy in a log.

    path: of the log. strategy: its name.
    decisions: its lines, at least one. n_others: number of decisions of other strategies.
    skipped: why lines cannot be read -> how many.
    """

    path: Path
    strategy: str
    decisions: list[LoggedDecision]
    n_others: int
    skipped: Counter[str]

    @property
    def parts(self) -> Mapping[str, Any]:
        """The description of the robot at the last decision."""
        parts: Mapping[str, Any] = self.decisions[-1].content["parts"]
        return parts

    def load(self, folder: Path | None, use: str) -> tuple[Domain, Program]:
        """Return the domain of the last decision, and its program with the rules of the classifiers.

        Args:
            folder: of the domain, if it is not the one of the log. use: of the program, for errors.

        Raises:
            DataError: the description has another form.
            LcorppError: a file is missing or wrong, or the domain has a reasoner of its own.
        """
        try:
            domain = load_logged_domain(self.parts, folder)
            program = read_program(self.parts, domain)
        except DataError:
            raise
        except DAMAGE as error:
            raise DataError(f"{self.path}: cannot be read: {describe_damage(error)}") from error
        domain.check_program_decides(use)
        return domain, program


def read_decisions(path: Path, strategy: str | None = None) -> StrategyDecisions:
    """Read the decisions of a strategy; by default of the one with the most, of equal ones the last one.

    Strategies of one run decide about the same people, so that only one of them is read.

    Raises:
        FileError: the log cannot be read.
        DataError: it has no decision of the strategy.
    """
    skipped, decisions = Counter[str](), list[LoggedDecision]()
    for line in read_log(path):
        if isinstance(line, DataError):
            skipped[str(line).partition(": ")[2]] += 1
        else:
            decisions.append(line)
    try:
        counts = Counter([str(line.strategy["name"]) for line in decisions])
        chosen = strategy or max(counts, key=lambda name: counts[name], default="")
        largest = [name for name in counts if counts[name] == counts.get(chosen)]
        chosen = strategy or (largest[-1] if largest else "")
        own = [line for line in decisions if line.strategy["name"] == chosen]
    except DAMAGE as error:
        raise DataError(f"{path}: cannot be read: {describe_damage(error)}") from error
    if not own:
        found = ", ".join(counts) or "none"
        raise DataError(
            f"{path}: no decision{f' of {strategy}' if strategy else ''}; strategies in it: {found}"
        )
    return StrategyDecisions(path, chosen, own, len(decisions) - len(own), skipped)
