"""Rewrite a program of plingo to rules of clingo: weights, experiments, evidence and queries become atoms.

    a :- b, &weight(2).                       {a} :- b.   lcorpp'soft(0,()) :- b, not a.
    :~ b. ["0.3"@0,x]                         lcorpp'weak("0.3",(x,)) :- b.
    &random(r) { f(X) : d(X) } :- b.          lcorpp'range(r,f(X)) :- d(X), b.   f(X) :- lcorpp'value(r,f(X)).
    &pr(r) { f(1) } = "1/6" :- b.             lcorpp'pr(r,f(1),"1/6",N) :- b.
    &obs { f(1) } = false.                    :- f(1).
    &do { f(1) }.                             f(1).   lcorpp'do(f(1)).
    &query(a).                                lcorpp'query(N,a).

Without a weight a rule is hard. Source: the README of plingo 1.1; Lee and Wang, "Weighted rules under the
stable model semantics", KR 2016; Lee and Yang, "LPMLN, weak constraints, and P-log", AAAI 2017.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import count

from clingo.ast import AST, ASTType, Sign, parse_string

from lcorpp.reasoning.language.answer_sets.asp_weights import compute_factor
from lcorpp.reasoning.language.issues import Place, SourceIssue

PREFIX = "lcorpp'"
"""Begins the names of the predicates that the rewriting adds."""

_WEIGHTS = ("weight", "log", "problog")
_HEADS = ("random", "pr", "obs", "do", "query", "evidence")

_REFUSED = {
    ASTType.External: "#external",
    ASTType.Edge: "#edge",
    ASTType.Heuristic: "#heuristic",
    ASTType.ProjectAtom: "#project",
    ASTType.ProjectSignature: "#project",
    ASTType.Script: "#script",
    ASTType.TheoryDefinition: "#theory",
}
"""Statements without translation."""

_IGNORED = {ASTType.ShowSignature, ASTType.ShowTerm, ASTType.Comment}

HIDDEN = re.compile(r'%\*.*?\*%|%[^\n]*|"(?:[^"\\\n]|\\.)*"', re.DOTALL)
"""Comments and texts."""

MAX_POOL = 100_000
"""Maximum number of rules that the pools of a statement, such as ``a(1;2)``, stand for."""

_VARIABLE = "Lcorpp'"

_INCLUDE = re.compile(r"#include\b")

_MESSAGE = re.compile(r"<string>:(\d+):(\d+)\S* error: (.*)", re.DOTALL)


@dataclass(eq=False)
class RewrittenProgram:
    """A program as rules of clingo, one statement a line.

    places: number of a line, from 1 -> place of its statement.
    factors: number of a soft rule -> e^w of its weight.
    """

    lines: list[str] = field(default_factory=list)
    places: dict[int, Place] = field(default_factory=dict)
    factors: list[Fraction] = field(default_factory=list)

    def add(self, at: Place, *texts: str) -> None:
        """Add rules of a statement, each ended by a point."""
        self.lines.append(" ".join(texts))
        self.places[len(self.lines)] = at


def rewrite_plingo(text: str, file: str, program: RewrittenProgram | None = None) -> RewrittenProgram:
    """Rewrite a program of plingo or LPMLN.

    Args:
        program: to which its rules are added; None for a new one.

    Raises:
        SourceIssue: the text is not of clingo's grammar, or has a construct without translation.
    """
    check_letters(text, file)
    messages: list[str] = []
    nodes: list[AST] = []
    try:
        parse_string(text, nodes.append, logger=lambda _, words: messages.append(words))
    except RuntimeError as error:
        words = messages[0] if messages else str(error)
        if found := _MESSAGE.match(words):
            place = Place(file, int(found[1]), int(found[2]))
            raise SourceIssue(place, " ".join(found[3].split())) from None
        raise SourceIssue(Place(file, 1, 1), words) from None
    reader = _Reader(file, RewrittenProgram() if program is None else program)
    for node in nodes:
        try:
            reader.rewrite(node)
        except RecursionError:
            begin = node.location.begin
            raise SourceIssue(Place(file, begin.line, begin.column), "a term nested too deeply") from None
    return reader.program


def check_letters(text: str, file: str) -> None:
    """Check that letters outside of texts and comments are ASCII, as clingo requires, and refuse #include.

    Raises:
        SourceIssue: another letter, or #include.
    """
    bare = HIDDEN.sub(lambda match: re.sub(r"[^\n]", " ", match[0]), text)
    if found := _INCLUDE.search(bare):
        place = _find_place(file, text, found.start())
        raise SourceIssue(place, "#include is not translated; expected one file")
    if found := re.search(r"[^\x00-\x7f]", bare):
        place = _find_place(file, text, found.start())
        raise SourceIssue(place, f"unexpected character {found[0]!r}; other letters need quotes")


def _find_place(file: str, text: str, position: int) -> Place:
    start = text.rfind("\n", 0, position) + 1
    return Place(file, text.count("\n", 0, position) + 1, position - start + 1)


class _Reader:
    def __init__(self, file: str, program: RewrittenProgram) -> None:
        self._file, self.program = file, program

    def rewrite(self, node: AST) -> None:
        """Rewrite a statement.

        Raises:
            SourceIssue: it has no translation.
        """
        kind = node.ast_type
        begin = node.location.begin
        at = Place(self._file, begin.line, begin.column)
        if kind in _IGNORED:
            return
        if kind in _REFUSED:
            raise SourceIssue(at, f"{_REFUSED[kind]} is not translated")
        if kind == ASTType.Program:
            if node.name != "base" or node.parameters:
                raise SourceIssue(at, f"#program {node.name} is not translated; expected the base program")
            return
        _check_names(node, at)
        if _count_rules(node) > MAX_POOL:
            raise SourceIssue(at, f"its pools stand for more than {MAX_POOL} rules")
        if kind == ASTType.Rule:
            self._rewrite_rule(node, at)
        elif kind == ASTType.Minimize:
            self._rewrite_minimize(node, at)
        else:  # constants and #defined
            self.program.add(at, str(node))

    # rules

    def _rewrite_rule(self, rule: AST, at: Place) -> None:
        weight, body = None, list[AST]()
        for literal in rule.body:
            atom = getattr(literal, "atom", None)
            if atom is None or atom.ast_type != ASTType.TheoryAtom:
                body.append(literal)
                continue
            name, arguments = atom.term.name, atom.term.arguments
            if name not in _WEIGHTS or literal.sign != Sign.NoSign or len(arguments) != 1:
                raise SourceIssue(at, f"&{name} in a body is not translated; expected &weight(w)")
            if weight is not None:
                raise SourceIssue(at, "a rule with two weights; expected one")
            weight = self._read_factor(name, _read_text(arguments[0]), at)
        if rule.head.ast_type == ASTType.TheoryAtom:
            if weight is not None:
                raise SourceIssue(at, f"a weight of &{rule.head.term.name} is not translated")
            self._rewrite_theory(rule.head, body, at)
        elif weight is None:
            self.program.add(at, _write_rule(str(rule.head), body))
        else:
            self._rewrite_soft(rule.head, body, weight, at)

    def _rewrite_soft(self, head: AST, body: Sequence[AST], factor: Fraction, at: Place) -> None:
        """Rewrite a soft rule: a choice, and its penalty where the body is true and the head is not."""
        body = _name_anonymous(body)
        negated = [*map(str, body)]
        texts = []
        if head.ast_type in (ASTType.Aggregate, ASTType.HeadAggregate):
            elements = "; ".join(map(str, head.elements))
            if head.ast_type == ASTType.HeadAggregate:
                raise SourceIssue(at, "a soft rule with an aggregate in its head is not translated")
            texts.append(_write_rule(f"{{ {elements} }}", body))
            if head.left_guard is None and head.right_guard is None:
                self.program.add(at, *texts)  # it is satisfied in each model
                return
            negated.append(f"not {head}")
        elif head.ast_type == ASTType.Literal:
            if head.atom.ast_type == ASTType.BooleanConstant:
                if head.atom.value == 1 and head.sign == Sign.NoSign:
                    return
            else:
                if head.atom.ast_type == ASTType.SymbolicAtom and head.sign == Sign.NoSign:
                    texts.append(_write_rule(f"{{ {head} }}", body))
                negated.append(f"not {head.atom if head.sign == Sign.DoubleNegation else head}")
        else:
            raise SourceIssue(at, "a soft rule with a disjunction in its head is not translated")
        number = len(self.program.factors)
        self.program.factors.append(factor)
        names: dict[str, None] = {}
        for node in (head, *body):
            _find_variables(node, names)
        instance = "".join(f"{name}," for name in names)
        soft = f"{PREFIX}soft({number},({instance}))"
        self.program.add(at, *texts, f"{soft} :- {'; '.join(negated)}." if negated else f"{soft}.")

    def _rewrite_minimize(self, node: AST, at: Place) -> None:
        if str(node.priority) != "0":
            raise SourceIssue(
                at, f"a weak constraint of priority {node.priority} is not translated; expected 0: a weight"
            )
        terms = "".join(f"{term}," for term in node.terms)
        self.program.add(at, _write_rule(f"{PREFIX}weak({node.weight},({terms}))", node.body))

    def _read_factor(self, kind: str, text: str, at: Place) -> Fraction:
        try:
            return compute_factor(kind, text)
        except ValueError as error:
            raise SourceIssue(at, str(error)) from None

    # theory atoms of heads

    def _rewrite_theory(self, atom: AST, body: Sequence[AST], at: Place) -> None:
        name, arguments = atom.term.name, atom.term.arguments
        if name not in _HEADS:
            raise SourceIssue(at, f"&{name} is not translated; expected one of &{', &'.join(_HEADS)}")
        guard = atom.guard
        if guard is not None and (guard.operator_name != "=" or name not in ("pr", "obs")):
            raise SourceIssue(at, f"&{name} with {guard.operator_name!r} is not translated")
        if name in ("query", "evidence") and atom.elements:
            raise SourceIssue(at, f"&{name} has no braces; expected &{name}(a)")
        if name == "query":
            if not 1 <= len(arguments) <= 2:
                raise SourceIssue(at, "&query has one atom, and perhaps one that is observed")
            written = ",".join(map(str, arguments))
            query = f"{PREFIX}query({len(self.program.lines)},{written})"
            self.program.add(at, _write_rule(query, body))
            return
        if name == "evidence":
            if not 1 <= len(arguments) <= 2 or (len(arguments) == 2 and str(arguments[1]) not in _TRUTH):
                raise SourceIssue(at, "&evidence has an atom, and perhaps true or false")
            is_true = len(arguments) == 1 or str(arguments[1]) == "true"
            self._observe(str(arguments[0]), is_true, body, at)
            return
        if len(atom.elements) != 1 or len(atom.elements[0].terms) != 1 or len(arguments) > 1:
            raise SourceIssue(at, f"&{name} has one atom in braces, &{name} {{ a(X) }}")
        element = atom.elements[0]
        value = element.terms[0]
        condition = list(element.condition)
        written = str(value)
        is_atom = re.match(r"-?[_']*[a-z]", written) is not None
        if not is_atom or (condition and name != "random"):
            raise SourceIssue(at, f"&{name} has one atom in braces, not {element}")
        if name in ("obs", "do") and arguments:
            raise SourceIssue(at, f"&{name} has no name")
        if name == "obs":
            truth = "true" if guard is None else str(guard.term)
            if truth not in _TRUTH:
                raise SourceIssue(at, f"&obs {{...}} = {truth}; expected true or false")
            self._observe(written, truth == "true", body, at)
            return
        if name == "do":
            self.program.add(at, _write_rule(written, body), _write_rule(f"{PREFIX}do({written})", body))
            return
        experiment = str(arguments[0]) if arguments else _name_experiment(value, at)
        if name == "random":
            self._add_experiments()
            ranged = f"{PREFIX}range({experiment},{written})"
            chosen = f"{written} :- {PREFIX}value({experiment},{written})."
            self.program.add(at, _write_rule(ranged, [*condition, *body]), chosen)
            return
        if guard is None:
            raise SourceIssue(at, '&pr {...} has a probability, = "1/4"')
        names: dict[str, None] = {}
        _find_variables(guard.term, names)
        text = str(guard.term)
        if not names and not text.startswith('"'):
            text = f'"{text}"'  # 1/2 is no division of integers
        number = f"{PREFIX}pr({experiment},{written},{text},{len(self.program.lines)})"
        self.program.add(at, _write_rule(number, body))

    def _add_experiments(self) -> None:
        """Add once that an experiment has a value of its range."""
        text = f"{{ {PREFIX}value(E,A) }} :- {PREFIX}range(E,A)."
        if text not in self.program.lines:
            self.program.add(Place(self._file, 1, 1), text)

    def _observe(self, atom: str, is_true: bool, body: Sequence[AST], at: Place) -> None:
        self.program.add(at, _write_rule("", [*body, f"not {atom}" if is_true else atom]))


_TRUTH = ("true", "false")


def _name_experiment(value: AST, at: Place) -> str:
    """Name the experiment without a name: the attribute and all arguments but the last."""
    arguments = getattr(value, "arguments", ())
    if not arguments:
        raise SourceIssue(at, f"{value} has no argument; expected one with the value last")
    return f"({value.name},({''.join(f'{each},' for each in arguments[:-1])}))"


def _read_text(argument: AST) -> str:
    """Return the text of a weight: a number, or an expression in quotes."""
    text = str(argument)
    return text[1:-1] if text.startswith('"') else text


def _write_rule(head: str, body: Sequence[AST | str]) -> str:
    written = "; ".join(map(str, body))
    return f"{head} :- {written}." if written else f"{head}."


def _find_variables(node: AST, names: dict[str, None]) -> None:
    """Find the global variables of a rule: those outside of aggregates and conditions."""
    if node.ast_type == ASTType.Variable:
        names[node.name] = None
    elif node.ast_type in (ASTType.Aggregate, ASTType.BodyAggregate, ASTType.ConditionalLiteral):
        return
    else:
        for part in _iter_parts(node):
            _find_variables(part, names)


def _iter_parts(node: AST) -> Iterator[AST]:
    for key in node.child_keys:
        child = getattr(node, key)
        if isinstance(child, AST):
            yield child
        elif child is not None:
            yield from child


def _name_anonymous(body: Sequence[AST]) -> list[AST]:
    """Name the anonymous variables of positive literals, so that each instance of a soft rule counts."""
    numbers = count(1)
    return [
        _rename(literal, numbers) if getattr(literal, "sign", None) == Sign.NoSign else literal
        for literal in body
    ]


def _rename(node: AST, numbers: Iterator[int]) -> AST:
    if node.ast_type == ASTType.Variable:
        return node.update(name=f"{_VARIABLE}{next(numbers)}") if node.name == "_" else node
    changes: dict[str, AST | list[AST]] = {}
    for key in node.child_keys:
        child = getattr(node, key)
        if isinstance(child, AST):
            changes[key] = _rename(child, numbers)
        elif child is not None:
            changes[key] = [_rename(each, numbers) for each in child]
    return node.update(**changes)


def _count_rules(node: AST) -> int:
    """Count the rules that the pools of a statement stand for."""
    own = len(node.arguments) if node.ast_type == ASTType.Pool else 1
    for part in _iter_parts(node):
        own *= _count_rules(part)
        if own > MAX_POOL:
            break
    return own


def _check_names(node: AST, at: Place) -> None:
    """Raise `SourceIssue` at a function of a script, or a name of the rewriting."""
    if node.ast_type == ASTType.Function:
        if node.external:
            raise SourceIssue(at, f"the function @{node.name} of a script is not translated")
        if node.name.startswith(PREFIX):
            raise SourceIssue(at, f"the name {node.name} is reserved")
    if node.ast_type == ASTType.Variable and node.name.startswith(_VARIABLE):
        raise SourceIssue(at, f"the name {node.name} is reserved")
    for part in _iter_parts(node):
        _check_names(part, at)
