"""Ground rules of a program in the language of clingo; clingo grounds it and solves nothing."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import clingo

from lcorpp.reasoning.language.issues import Place, SourceIssue

MAX_GROUND_RULES = 200_000
"""Maximum number of ground rules; a program without an end, such as ``n(X+1) :- n(X).``, reaches it."""

_MESSAGE = re.compile(r"<block>:(\d+):\S* (?:error|info): (.*)", re.DOTALL)


@dataclass(frozen=True)
class GroundRule:
    """A ground rule, or a choice: each of the heads is true or not where the body is.

    heads: atoms, none for a constraint. body: atoms, negated if they are negative.
    """

    heads: tuple[int, ...]
    body: tuple[int, ...]
    is_choice: bool


@dataclass(frozen=True)
class SumRule:
    """A ground rule whose body is that a sum of weights of literals is at least `bound`."""

    heads: tuple[int, ...]
    bound: int
    literals: tuple[tuple[int, int], ...]
    is_choice: bool


@dataclass(eq=False)
class GroundAnswerSets:
    """The ground rules of a program.

    symbols: atom -> its symbol; atoms of clingo's own have none.
    """

    rules: list[GroundRule] = field(default_factory=list)
    sums: list[SumRule] = field(default_factory=list)
    symbols: dict[int, clingo.Symbol] = field(default_factory=dict)


class _TooManyRulesError(Exception):
    pass


class _RuleCollector:
    """Collects the rules as clingo grounds them; an observer of `clingo.Control`."""

    def __init__(self) -> None:
        self.ground, self._count = GroundAnswerSets(), 0

    def rule(self, choice: bool, head: Sequence[int], body: Sequence[int]) -> None:
        self._check(1 + len(head) + len(body))
        self.ground.rules.append(GroundRule(tuple(head), tuple(body), choice))

    def weight_rule(
        self, choice: bool, head: Sequence[int], lower_bound: int, body: Sequence[tuple[int, int]]
    ) -> None:
        self._check(1 + len(head) + len(body))
        self.ground.sums.append(SumRule(tuple(head), lower_bound, tuple(body), choice))

    def _check(self, size: int) -> None:
        self._count += size
        if self._count > 8 * MAX_GROUND_RULES or len(self.ground.rules) > MAX_GROUND_RULES:
            raise _TooManyRulesError


def ground_answer_sets(lines: Sequence[str], places: Mapping[int, Place]) -> GroundAnswerSets:
    """Ground a program, given as one statement a line.

    Args:
        places: number of a line, from 1 -> place of its statement.

    Raises:
        SourceIssue: an unsafe variable, a term without a value, or more than `MAX_GROUND_RULES` rules.
    """
    first = next(iter(places.values()), Place("", 1, 1))
    messages: list[tuple[clingo.MessageCode, str]] = []
    control = clingo.Control(["--warn=all"], lambda code, text: messages.append((code, text)), 50)
    collector = _RuleCollector()
    control.register_observer(collector)
    try:
        control.add("base", [], "\n".join(lines))
        control.ground([("base", [])])
    except _TooManyRulesError:
        raise SourceIssue(
            first, f"the program has more than {MAX_GROUND_RULES} ground rules, or no end of them"
        ) from None
    except RuntimeError as error:
        raise _make_issue(messages, str(error), places, first) from None
    undefined = [
        (code, text)
        for code, text in messages
        if code == clingo.MessageCode.OperationUndefined and "tuple ignored" not in text
    ]
    if undefined:
        raise _make_issue(undefined, "", places, first)
    collector.ground.symbols.update([(atom.literal, atom.symbol) for atom in control.symbolic_atoms])
    return collector.ground


def _make_issue(
    messages: Sequence[tuple[clingo.MessageCode, str]],
    otherwise: str,
    places: Mapping[int, Place],
    first: Place,
) -> SourceIssue:
    """Make the issue of a message of clingo, at the place of its statement."""
    text = messages[0][1] if messages else otherwise
    found = _MESSAGE.match(text)
    if found is None:
        return SourceIssue(first, f"clingo refuses the program: {text.strip()}")
    line, words = int(found[1]), " ".join(found[2].replace("<block>:", "line ").split())
    words = re.sub(r"line \d+:\S+ note: ", "", words).replace("lcorpp'", "").replace("[#inc_base]", "")
    return SourceIssue(places.get(line, first), words)
