"""Clauses of ProbLog: heads with probabilities, bodies of goals; what has no translation is refused by name.

A body is a disjunction of conjunctions. A negated conjunction becomes a predicate of its own, whose arguments
are the variables that the clause has outside of it, too.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import chain, product

from lcorpp.reasoning.language.issues import Place, SourceIssue
from lcorpp.reasoning.language.translation.names import make_case_name
from lcorpp.reasoning.language.translation.prolog_arithmetic import is_function
from lcorpp.reasoning.language.translation.prolog_builtins import BUILTINS
from lcorpp.reasoning.language.translation.prolog_terms import (
    Compound,
    PrologTerm,
    PrologVariable,
    iter_term_variables,
    unquote,
)

MAX_ALTERNATIVES = 1000
"""A body has at most this many conjunctions."""

_REFUSED_GOALS = {
    "!": "a cut (!)",
    "->": "if-then-else (->)",
    "*->": "if-then-else (*->)",
    "~": "a distribution (~)",
    "::": "a probability in a body",
    "findall": "findall",
    "all": "all",
    "aggregate": "aggregate",
    "subquery": "subquery",
    "=>": "a rule of logic (=>)",
}
"""Goals without translation, whatever their arguments."""

_REFUSED_STATEMENTS = {
    "utility": "a utility (DTProbLog)",
    "-->": "a grammar rule (-->)",
    "~": "a distribution (~)",
    "|": "a disjunction with '|'",
    "&": "a conjunction with '&'",
}

_LIBRARIES = {
    Compound("library", (Compound(name),))
    for name in ("aggregate", "apply", "assert", "collect", "control", "cut", "lists", "record", "string")
}
"""Libraries of ProbLog whose import changes no other predicate."""

_DENSITIES = {
    "normal", "gaussian", "uniform", "beta", "gamma", "poisson", "exponential", "exp", "bernoulli",
    "discrete", "finite", "dirichlet", "binomial", "geometric", "student_t", "laplace", "cauchy",
}  # fmt: skip


@dataclass(frozen=True)
class Goal:
    """An atom of a body, or its negation."""

    term: Compound
    negated: bool
    at: Place


Conjunction = tuple[Goal, ...]


@dataclass(frozen=True)
class PrologClause:
    """`p1::a1; p2::a2 :- body.`

    heads: each with its probability, None if it is not written; then there is one head.
    alternatives: the conjunctions of the body, a fact has the empty one.
    variables: those that distinguish the choices of a clause with probabilities: all but the variables that
        only negated goals have.
    """

    heads: tuple[tuple[PrologTerm | None, Compound], ...]
    alternatives: tuple[Conjunction, ...]
    variables: tuple[PrologVariable, ...]
    at: Place

    @property
    def is_random(self) -> bool:
        """Whether the clause has probabilities."""
        return self.heads[0][0] is not None


def make_clauses(statements: Iterable[tuple[Place, PrologTerm]]) -> list[PrologClause]:
    """Make clauses of the terms of a program; `query` and `evidence` are predicates, too.

    Raises:
        SourceIssue: a construct has no translation, which the message names.
    """
    return list(chain.from_iterable(_ClauseMaker(at, term).make() for at, term in statements))


class _ClauseMaker:
    """Makes the clauses of one statement."""

    def __init__(self, at: Place, term: PrologTerm) -> None:
        self._at, self._term = at, term
        self._added: list[PrologClause] = []
        self._counts = Counter(iter_term_variables(term))

    def make(self) -> list[PrologClause]:
        term, at = self._term, self._at
        if isinstance(term, Compound) and term.key == (":-", 1):
            return self._check_directive(term.arguments[0])
        head, body = term, None
        if isinstance(term, Compound) and term.key in ((":-", 2), ("<-", 2)):
            head, body = term.arguments
        heads = tuple(map(self._make_head, _flatten(head, ";")))
        if len(heads) > 1 and any(probability is None for probability, _ in heads):
            raise SourceIssue(at, "a disjunction in a head without probabilities is not translated")
        alternatives = ((),) if body is None else self._make_alternatives(body)
        parts = [part for pair in heads for part in pair if part is not None]
        goals = [goal.term for goals in alternatives for goal in goals if not goal.negated]
        variables = dict.fromkeys(chain.from_iterable(map(iter_term_variables, [*parts, *goals])))
        return [PrologClause(heads, alternatives, tuple(variables), at), *self._added]

    def _check_directive(self, directive: PrologTerm) -> list[PrologClause]:
        """Accept the import of a library, as a predicate of it that is used has no clause."""
        if isinstance(directive, Compound) and directive.name == "use_module":
            library = directive.arguments[0]
            if isinstance(library, Compound) and library in _LIBRARIES:
                return []
        raise SourceIssue(self._at, f"the directive :- {directive} is not translated")

    def _make_head(self, term: PrologTerm) -> tuple[PrologTerm | None, Compound]:
        probability = None
        if isinstance(term, Compound) and term.key == ("::", 2):
            probability, term = term.arguments
            if words := _name_weight(probability):
                raise SourceIssue(self._at, f"{words} is not translated")
        if not isinstance(term, Compound):
            raise SourceIssue(self._at, f"expected an atom, not {term}")
        term = _unquote(term)
        if term.key == ("\\+", 1):
            raise SourceIssue(term.at, f"the negated head {term} is not translated")
        if words := _REFUSED_STATEMENTS.get(term.name):
            raise SourceIssue(term.at, f"{words} is not translated")
        if term.name in _CONTROL or term.name in ("[]", ".", ":-", "<-") or term.name[0] in '"?':
            raise SourceIssue(term.at, f"expected an atom, not {term}")
        if term.key in BUILTINS:
            raise SourceIssue(
                term.at, f"a clause for the builtin predicate {term.name}/{len(term.arguments)}"
            )
        if probability is not None and term.name in ("query", "evidence"):
            raise SourceIssue(term.at, f"a probability of {term.name}(...) is not translated")
        return probability, term

    # bodies

    def _make_alternatives(self, body: PrologTerm) -> tuple[Conjunction, ...]:
        found: list[Conjunction] = []
        for case in _flatten(body, ";"):
            parts = [self._make_goals(part) for part in _flatten(case, ",")]
            for choice in product(*parts):
                found.append(tuple(chain.from_iterable(choice)))
                if len(found) > MAX_ALTERNATIVES:
                    raise SourceIssue(self._at, f"a body of more than {MAX_ALTERNATIVES} cases")
        return tuple(found)

    def _make_goals(self, term: PrologTerm) -> tuple[Conjunction, ...]:
        """Make the alternatives of a goal."""
        if isinstance(term, PrologVariable):
            raise SourceIssue(self._at, f"the goal {term}, a variable, is not translated")
        if not isinstance(term, Compound):
            raise SourceIssue(self._at, f"expected a goal, not {term}")
        term = _unquote(term)
        if words := _REFUSED_GOALS.get(term.name):
            raise SourceIssue(term.at, f"{words} is not translated")
        if term.name in (",", ";") and len(term.arguments) == 2:
            return self._make_alternatives(term)
        if term.key in (("call", 1), ("once", 1)):  # ProbLog finds all solutions of both
            return self._make_goals(term.arguments[0])
        if term.key == ("forall", 2):
            condition, conclusion = term.arguments
            violated = Compound(",", (condition, Compound("\\+", (conclusion,), term.at)), term.at)
            return self._make_negation(Compound("\\+", (violated,), term.at))
        if term.key == ("true", 0):
            return ((),)
        if term.key in (("fail", 0), ("false", 0)):
            return ()
        if term.name in ("\\+", "not") and term.arguments:
            return self._make_negation(term)
        if term.name[0] == '"' or term.name in ("[]", "."):
            raise SourceIssue(term.at, f"expected a goal, not {term}")
        return ((Goal(term, False, term.at),),)

    def _make_negation(self, term: Compound) -> tuple[Conjunction, ...]:
        inner, at = term.arguments[0], term.at
        for other in term.arguments[1:]:
            inner = Compound(",", (inner, other), at)
        alternatives = self._make_alternatives(inner)
        if not alternatives:
            return ((),)
        if len(alternatives) == 1 and len(alternatives[0]) == 1 and not alternatives[0][0].negated:
            return ((Goal(alternatives[0][0].term, True, at),),)
        own = Counter(iter_term_variables(inner))
        shared = tuple(name for name in own if self._counts[name] > own[name])
        head = Compound(make_case_name(self._at, len(self._added) + 1), shared, at)
        self._added.append(PrologClause(((None, head),), alternatives, (), at))
        return ((Goal(head, True, at),),)


_CONTROL = {",", ";", "->", "*->", "\\+", "not", "!", "::", "true", "fail", "false", "call", "forall"}


def _flatten(term: PrologTerm, sign: str) -> Iterator[PrologTerm]:
    """Iterate over the parts of a conjunction or disjunction."""
    waiting = [term]
    while waiting:
        part = waiting.pop()
        if isinstance(part, Compound) and part.key == (sign, 2):
            waiting += reversed(part.arguments)
        else:
            yield part


def _unquote(term: Compound) -> Compound:
    """Return an atom whose predicate has no quotes, which only arguments keep."""
    return Compound(unquote(term.name), term.arguments, term.at)


def _name_weight(term: PrologTerm) -> str | None:
    """Name what is written in the place of a probability, None for an expression."""
    if not isinstance(term, Compound):
        return None
    if term.name == "?":
        return "a decision, ?:: (DTProbLog),"
    if term.name == "t" and term.arguments:
        return f"the learnable probability {term}, which lcorpp fit estimates,"
    if term.name in _DENSITIES and not is_function(term):
        return f"the density {term}"
    return None
