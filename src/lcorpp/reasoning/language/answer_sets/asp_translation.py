"""Write the ground rules of a program with weights as P-log.

An atom is a boolean term, and false where it is not true; if the program has ``-a``, that is its value false,
and it may have no value. A choice ``{a} :- b`` is a random term of equal probabilities, which is true exactly
if `a` is true and a choice of it is open: so each answer set is one world, whatever else derives `a`. An
experiment of `&random` is a random term, whose values are atoms. A weight is a likelihood: an observation
whose probability is e^w times as large where the condition is true. Worlds then have the probabilities of
answer sets, but for a factor.
"""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from typing import NamedTuple

from clingo import Symbol, SymbolType

from lcorpp.reasoning.language.answer_sets.asp_grounding import GroundAnswerSets
from lcorpp.reasoning.language.answer_sets.asp_rules import Body, RuleTable
from lcorpp.reasoning.language.answer_sets.asp_weights import compute_factor, evaluate_number
from lcorpp.reasoning.language.answer_sets.plingo_reader import PREFIX, RewrittenProgram
from lcorpp.reasoning.language.arithmetic import MAX_INTEGER
from lcorpp.reasoning.language.issues import Place, SourceIssue
from lcorpp.reasoning.quoting import make_name_text, make_value_text, write_name


class _Experiment(NamedTuple):
    """An experiment.

    key: the attribute and its arguments, if all its values are of one, which has no other experiment: then
        ``roll(d1,3)`` is ``roll(d1) = 3``, too. None for an attribute of its own.
    values: symbol of an atom -> the atom that it is in the range.
    """

    number: int
    key: _Key | None
    values: dict[Symbol, int]


_Key = tuple[str, tuple[Symbol, ...]]


def translate_answer_sets(program: RewrittenProgram, ground: GroundAnswerSets) -> tuple[str, dict[str, str]]:
    """Translate a grounded program to the text of a P-log program, and the names in it that are not its own.

    Raises:
        SourceIssue: a disjunction depends on itself, or a number is no probability.
    """
    return AnswerSetWriter(program, ground).write()


class AnswerSetWriter:
    """Writes a grounded program as P-log; errors as of `translate_answer_sets`."""

    def __init__(self, program: RewrittenProgram, ground: GroundAnswerSets) -> None:
        self._program, self._symbols = program, ground.symbols
        self._at = next(iter(program.places.values()), Place("", 1, 1))
        self._lines: list[str] = []
        self._names: dict[str, str] = {}
        self._taken = {symbol.name for symbol in ground.symbols.values()}
        self._texts: dict[int, str] = {}  # atom -> its literal, once it is made
        self._uses: dict[tuple[str, int], list[dict[str, None]]] = {}
        rules = RuleTable(ground, self._at)
        self._bodies, self._choices, self._constraints = rules.bodies, rules.choices, rules.constraints
        self._by_name: dict[str, list[tuple[int, Symbol]]] = defaultdict(list)
        for atom, symbol in ground.symbols.items():
            if symbol.name.startswith(PREFIX):
                self._by_name[symbol.name.removeprefix(PREFIX)].append((atom, symbol))
        self._atom_of = {symbol: atom for atom, symbol in ground.symbols.items()}
        self._values = {tuple(symbol.arguments): atom for atom, symbol in self._by_name["value"]}
        self._sorts: dict[int, str] = {}
        # attributes of experiments: the values of their arguments and their own, and the symbols of these
        self._outcomes: dict[tuple[str, int], list[dict[str, None]]] = {}
        self._narrow: dict[tuple[str, int], set[Symbol]] = {}
        self._experiments = self._find_experiments()
        queried = [symbol.arguments[-1] for _, symbol in self._by_name["query"]]
        named = [s for s in (*ground.symbols.values(), *queried) if s.type == SymbolType.Function]
        self._negated = {(s.name, len(s.arguments)) for s in named if s.negative}

    def _find_experiments(self) -> dict[Symbol, _Experiment]:
        values: dict[Symbol, dict[Symbol, int]] = defaultdict(dict)
        for atom, symbol in self._by_name["range"]:
            values[symbol.arguments[0]][symbol.arguments[1]] = atom
        keys = {experiment: set(map(_find_key, own)) for experiment, own in values.items()}
        users = Counter(key for own in keys.values() for key in own)
        predicates = {(symbol.name, len(symbol.arguments)) for symbol in self._symbols.values()}
        found = {}
        for number, (experiment, own) in enumerate(values.items(), 1):
            key = next(iter(keys[experiment]))
            attribute = key[0], len(key[1])
            is_atom = all(value.type == SymbolType.Function and not value.negative for value in own)
            is_plain = is_atom and attribute not in predicates
            if len(keys[experiment]) == users[key] == 1 and is_plain:
                self._narrow.setdefault(attribute, set()).update(value.arguments[-1] for value in own)
                found[experiment] = _Experiment(number, key, own)
            else:
                found[experiment] = _Experiment(number, None, own)
        return found

    def list_choices(self) -> list[tuple[int, list[str], str]]:
        """List the choices of probabilistic facts and disjunctions: their number, values and term.

        Raises:
            SourceIssue: a probabilistic fact depends on chance.
        """
        found = []
        for atom, symbol in self._by_name["fact"]:
            if not self._is_random(atom):
                words = (
                    f"the probability of {symbol.arguments[1]}, which depends on chance, is not translated"
                )
                raise SourceIssue(self._at, words)
            found.append((symbol.arguments[0].number, ["true", "false"], self._find_text(atom)))
        for experiment, own in self._experiments.items():
            if experiment.name == "choice":
                literals = [self._texts[self._values[experiment, value]] for value in own.values]
                values = [literal.partition(" = ")[2] for literal in literals]
                found.append((experiment.arguments[0].number, values, literals[0].partition(" = ")[0]))
        return found

    # writing

    def write(self) -> tuple[str, dict[str, str]]:
        self._lines.append("")  # that of the declarations
        for experiment, own in self._experiments.items():
            self._write_experiment(experiment, own)
        self._merge_weights()
        odds = self._fold_weights()
        values = {atom for atom, _ in self._by_name["value"]}
        queries = {atom for atom, _ in self._by_name["query"]}
        hidden = values | queries | {atom for atom, _ in (*self._by_name["do"], *self._by_name["pr"])}
        hidden |= {atom for own in self._experiments.values() for atom in own.values.values()}
        for atom in sorted({*self._bodies, *self._choices, *self._symbols} - hidden):
            self._write_atom(atom, odds.get(atom))
        for body in self._constraints:
            self._lines.append(f":- {self._write_body(body)}." if body else ":- 1 = 1.")
        queried = sorted([symbol for _, symbol in self._by_name["query"]])
        for symbol in sorted(queried, key=lambda own: own.arguments[0].number):  # by their lines
            self._write_query(symbol.arguments[1:])
        self._lines[0] = "\n".join(self._list_declarations())
        return "\n".join([*self._lines, ""]), self._names

    def _write_atom(self, atom: int, odds: Fraction | None) -> None:
        """Write the rules and choices of an atom.

        Args:
            odds: of an atom whose weights are its probability.
        """
        bodies, choices = self._bodies.get(atom, {}), self._choices.get(atom, {})
        symbol = self._symbols.get(atom)
        if symbol is not None and symbol.name in (f"{PREFIX}soft", f"{PREFIX}weak"):
            if odds is None and bodies:
                self._write_weight(atom, symbol)
            return
        text = self._find_text(atom)
        if self._is_random(atom):
            self._lines.append(f"random({text}).")
            if odds is not None:
                self._lines.append(f"pr({text}) = {_write_fraction(odds / (1 + odds))}.")
            return
        for body in () if () in bodies else bodies:
            self._lines.append(f"{text} :- {self._write_body(body)}.")
        if () in bodies:
            self._lines.append(f"{text}.")
            return
        if symbol is not None and (symbol.name, len(symbol.arguments)) not in self._negated:
            self._lines.append(f"-{text} :- not {text}.")
        if choices:
            own: list[Body] = [()] if () in choices else list(choices)
            self._write_choice(text, str(symbol), own, is_derived=bool(bodies))

    def _write_choice(self, text: str, of: str, choices: Sequence[Body], *, is_derived: bool) -> None:
        """Write the choices of an atom, given by their bodies; is_derived: whether it has rules, too."""
        choice = self._make_name("choice", of)
        self._lines.append(f"{choice} : boolean. random({choice}).")
        opens = [self._write_body(body) for body in choices]
        if len(opens) > 1:
            name = self._make_name("open", of)
            self._lines.append(f"{name} : boolean.")
            self._lines += [f"{name} :- {body}." for body in opens]
            self._lines += [f"{text} :- {choice}, {body}." for body in opens]
            opened = name
        else:
            (opened,) = opens
            self._lines.append(f"{text} :- {', '.join(filter(None, [choice, opened]))}.")
            if opened and len(choices[0]) > 1:
                name = self._make_name("open", of)
                self._lines.append(f"{name} : boolean. {name} :- {opened}.")
                opened = name
        if opened:
            self._lines.append(f":- {choice}, {_negate(opened)}.")
        if is_derived or len(choices) > 1:  # else only the choice derives the atom
            self._lines.append(f":- {', '.join(filter(None, [text, opened]))}, not {choice}.")

    def _is_random(self, atom: int) -> bool:
        """Whether an atom is a choice without condition, and nothing else derives it or its negation."""
        symbol = self._symbols.get(atom)
        is_free = symbol is not None and (symbol.name, len(symbol.arguments)) not in self._negated
        return is_free and () in self._choices.get(atom, ()) and not self._bodies.get(atom)

    def _write_experiment(self, experiment: Symbol, own: _Experiment) -> None:
        done = [symbol.arguments[0] for _, symbol in self._by_name["do"]]
        if {_find_key(value) for value in own.values} <= {_find_key(value) for value in done}:
            self._write_intervention(experiment, own, [value for value in done if value in own.values])
            return
        texts = self._write_outcomes(experiment, own)
        term = next(iter(texts.values())).partition(" = ")[0]
        values = {value: text.partition(" = ")[2] for value, text in texts.items()}
        is_open = any(() not in self._bodies[atom] for atom in own.values.values())
        if not is_open and not self._is_narrow(own):
            self._lines.append(f"random({term}).")
        else:
            kinds = ("range", "on") if is_open else ("range",)
            ranged, *active = [self._make_name(kind, str(experiment)) for kind in kinds]
            self._lines.append(f"{ranged} : {self._find_outcome_sort(own)} -> boolean.")
            self._lines += [f"{each} : boolean." for each in active]
            for value, atom in own.values.items():
                self._texts[atom] = f"{ranged}({values[value]})"
                bodies = [self._write_body(body) for body in self._bodies[atom]]
                self._lines += [f"{self._texts[atom]}{' :- ' if body else ''}{body}." for body in bodies]
                self._lines += [f"{each} :- {self._texts[atom]}." for each in active]
            condition = f" :- {active[0]}" if active else ""
            self._lines.append(f"random({term} : {{X : {ranged}(X)}}){condition}.")
        for value, ranged_atom in own.values.items():
            chosen = self._values[experiment, value]
            self._texts[chosen] = texts[value]
            derived = self._atom_of.get(value)
            if derived is None:
                continue
            others = self._bodies[derived].keys() - {(chosen,)}
            if others or self._choices.get(derived):  # what else is derived is the value
                parts = [self._find_text(derived), *([self._texts[ranged_atom]] if is_open else [])]
                self._lines.append(f":- {', '.join(parts)}, not {texts[value]}.")
        for atom, symbol in self._by_name["pr"]:
            owner, value, number, _ = symbol.arguments
            if owner == experiment and value in own.values:
                self._write_number(atom, texts[value], number)

    def _write_outcomes(self, experiment: Symbol, own: _Experiment) -> dict[Symbol, str]:
        """Write value -> literal that the experiment has it; declare the attribute of an experiment alone."""
        if own.key is None:
            name = self._make_name("experiment", str(experiment))
            texts = {value: self._write_value(value) for value in own.values}
            self._lines.append(f"{name}s = {{{', '.join(texts.values())}}}. {name} : {name}s.")
            self._sorts[own.number] = f"{name}s"
            return {value: f"{name} = {text}" for value, text in texts.items()}
        name, given = own.key
        arguments = list(map(self._write_value, given))
        uses = self._outcomes.setdefault((name, len(given)), [{} for _ in (*given, "")])
        texts = {}
        for value in own.values:
            text = self._write_value(value.arguments[-1])
            texts[value] = f"{write_name(make_name_text(name))}{_parenthesize(arguments)} = {text}"
            for known, each in zip(uses, (*arguments, text), strict=True):
                known[each] = None
        return texts

    def _find_outcome_sort(self, own: _Experiment) -> str:
        if own.key is None:
            return self._sorts[own.number]
        name, given = own.key
        return f"{self._name_sorts(name, len(given))}v"

    def _name_sorts(self, name: str, count: int) -> str:
        """Name the sorts of an attribute of experiments, but for the number of the argument."""
        return f"outcome'{list(self._narrow).index((name, count)) + 1}_"

    def _is_narrow(self, own: _Experiment) -> bool:
        """Whether other experiments of the attribute have values that this one has not."""
        if own.key is None:
            return False
        name, given = own.key
        return {value.arguments[-1] for value in own.values} != self._narrow[name, len(given)]

    def _write_intervention(self, experiment: Symbol, own: _Experiment, done: Sequence[Symbol]) -> None:
        """Write that an experiment has the value of an intervention: the others are false.

        Raises:
            SourceIssue: the intervention depends on chance, or its value may be outside of the range.
        """
        for atom, symbol in self._by_name["do"]:
            if symbol.arguments[0] in own.values and () not in self._bodies[atom]:
                raise SourceIssue(self._at, f"&do {{ {symbol.arguments[0]} }} depends on chance")
        if not done or () not in self._bodies[own.values[done[0]]]:
            raise SourceIssue(self._at, "&do outside of the range of its experiment is not translated")
        for symbol, ranged in own.values.items():
            atom = self._atom_of[symbol]
            self._bodies[atom].pop((self._values[experiment, symbol],), None)
            if symbol == done[0]:
                continue
            if () in self._bodies[ranged]:
                self._constraints[(atom,)] = None
                continue
            if ranged not in self._texts:
                self._texts[ranged] = self._make_name("range", str(experiment))
                self._lines.append(f"{self._texts[ranged]} : boolean.")
                self._lines += [
                    f"{self._texts[ranged]} :- {self._write_body(body)}." for body in self._bodies[ranged]
                ]
            self._constraints[tuple(sorted({atom, ranged}))] = None

    def _write_number(self, atom: int, value: str, number: Symbol) -> None:
        """Write a pr-atom; its condition is an attribute unless it is always true."""
        text = number.string if number.type == SymbolType.String else str(number)
        try:
            p = evaluate_number(text)
        except ValueError as error:
            raise SourceIssue(self._at, str(error)) from None
        if not 0 <= p <= 1:
            raise SourceIssue(self._at, f"&pr {{...}} = {text}; expected a probability from 0 to 1")
        bodies = self._bodies[atom]
        condition = ""
        if () not in bodies:
            name = self._make_name("case", "pr")
            self._lines.append(f"{name} : boolean.")
            self._lines += [f"{name} :- {self._write_body(body)}." for body in bodies]
            condition = f" | {name}"
        self._lines.append(f"pr({value}{condition}) = {_write_fraction(p)}.")

    # weights

    def _merge_weights(self) -> None:
        """Merge weak constraints of one weight and tuple, which count once: [1@0,t] and ["1"@0,t]."""
        first: dict[tuple[Fraction, Symbol], int] = {}
        for atom, symbol in list(self._by_name["weak"]):
            key = self._find_factor(symbol), symbol.arguments[1]
            if first.setdefault(key, atom) != atom:
                self._bodies[first[key]].update(self._bodies.pop(atom))
                self._by_name["weak"].remove((atom, symbol))

    def _fold_weights(self) -> dict[int, Fraction]:
        """Fold weights about one random atom into its odds; a folded weight is there with odds 1, too."""
        odds: dict[int, Fraction] = {}
        for kind in ("soft", "weak"):
            for atom, symbol in self._by_name[kind]:
                bodies = list(self._bodies.get(atom, ()))
                if len(bodies) == 1 and len(bodies[0]) == 1 and self._is_random(abs(bodies[0][0])):
                    factor, literal = self._find_factor(symbol), bodies[0][0]
                    one = odds.get(abs(literal), Fraction(1))
                    odds[abs(literal)] = one * factor if literal > 0 else one / factor
                    odds[atom] = Fraction(1)
        return odds

    def _find_factor(self, symbol: Symbol) -> Fraction:
        """Return the factor of a model in which the atom of a weight is true."""
        first = symbol.arguments[0]
        if symbol.name == f"{PREFIX}soft":
            number: int = first.number
            return 1 / self._program.factors[number]  # the penalty of a rule that is not satisfied
        text = first.string if first.type == SymbolType.String else str(first)
        try:
            return compute_factor("weight", text)
        except ValueError as error:
            raise SourceIssue(self._at, f"a weak constraint: {error}") from None

    def _write_weight(self, atom: int, symbol: Symbol) -> None:
        factor = self._find_factor(symbol)
        if factor == 1 or () in self._bodies[atom]:  # the same for all models
            return
        holds, seen = self._make_name("holds", "weight"), self._make_name("weight", "weight")
        self._lines.append(f"{holds}, {seen} : boolean. random({seen}).")
        self._lines += [f"{holds} :- {self._write_body(body)}." for body in self._bodies[atom]]
        numbers = (Fraction(1), 1 / factor) if factor > 1 else (factor, Fraction(1))
        high, low = map(_write_fraction, numbers)
        self._lines += [
            f"-{holds} :- not {holds}. :- not {seen}.",
            f"pr({seen} | {holds}) = {high}. pr({seen} | -{holds}) = {low}.",
        ]

    # names and literals

    def _write_query(self, arguments: Sequence[Symbol]) -> None:
        texts = [self._write_symbol(symbol) for symbol in arguments]
        given = f" | obs({texts[1]})" if len(texts) == 2 else ""
        self._lines.append(f"?{{{texts[0]}}}{given}.")

    def _write_body(self, body: Body) -> str:
        """Write a body, positive literals first."""
        texts = [self._find_text(literal) for literal in body if literal > 0]
        return ", ".join([*texts, *[f"not {self._find_text(-literal)}" for literal in body if literal < 0]])

    def _find_text(self, atom: int) -> str:
        if atom not in self._texts:
            symbol = self._symbols.get(atom)
            if symbol is None:
                name = self._make_name("part", "aggregate or condition")
                self._lines.append(f"{name} : boolean.")
                self._texts[atom] = name
            else:
                self._texts[atom] = self._write_symbol(symbol)
        return self._texts[atom]

    def _write_symbol(self, symbol: Symbol) -> str:
        """Write an atom as a literal, and register its use."""
        if symbol.type != SymbolType.Function or not symbol.name:
            raise SourceIssue(self._at, f"{symbol} is no atom")
        arguments = list(map(self._write_value, symbol.arguments))
        uses = self._uses.setdefault((symbol.name, len(arguments)), [{} for _ in arguments])
        for known, text in zip(uses, arguments, strict=True):
            known[text] = None
        sign, name = "-" if symbol.negative else "", _write_predicate(symbol.name)
        if symbol.name.startswith(PREFIX):
            self._names[name] = f"[{name.removesuffix(chr(39))}]"
        return f"{sign}{name}{_parenthesize(arguments)}"

    def _write_value(self, symbol: Symbol) -> str:
        """Write a term of clingo as a value: compound terms and texts are names in quotes."""
        if symbol.type == SymbolType.Number and abs(symbol.number) <= MAX_INTEGER:
            return str(symbol.number)
        return write_name(make_value_text(str(symbol)))

    def _make_name(self, kind: str, of: str) -> str:
        """Make the name of an attribute that is not of the program."""
        number = 1 + len(self._names)
        while f"{kind}'{number}" in self._taken:
            number += 1
        name = f"{kind}'{number}"
        self._taken.add(name)
        self._names[name] = f"[{kind} {of}]"
        return name

    def _list_declarations(self) -> Iterator[str]:
        for number, ((name, _), uses) in enumerate(self._uses.items(), 1):
            yield from _declare(name, f"sort'{number}_", uses, "boolean")
        for (name, count), uses in self._outcomes.items():
            yield from _declare(name, self._name_sorts(name, count), uses, None)


def _declare(name: str, sort: str, uses: Sequence[Mapping[str, None]], target: str | None) -> Iterator[str]:
    """Declare an attribute; uses: the values of each argument, and without `target` those of its own."""
    sorts = []
    for index, values in enumerate(uses, 1):
        is_last = target is None and index == len(uses)
        if values.keys() <= {"true", "false"} and not is_last:
            sorts.append("boolean")
        else:
            sorts.append(f"{sort}{'v' if is_last else index}")
            yield f"{sorts[-1]} = {{{', '.join(values)}}}."
    result = sorts.pop() if target is None else target
    yield f"{_write_predicate(name)} : {', '.join(sorts)}{' -> ' if sorts else ''}{result}."


def _find_key(symbol: Symbol) -> _Key:
    """Return the attribute of an atom and its arguments but the value, the last; a number has none."""
    if symbol.type != SymbolType.Function:
        return "", ()
    return symbol.name, tuple(symbol.arguments[:-1])


def _write_predicate(name: str) -> str:
    """Write the name of a predicate; one of the rewriting has the apostrophe last."""
    if name.startswith(PREFIX):
        return f"{name.removeprefix(PREFIX)}'"
    return name if re.fullmatch(r"[a-z]\w*'[\w']*", name, re.ASCII) else write_name(make_name_text(name))


def _parenthesize(arguments: Sequence[str]) -> str:
    return f"({', '.join(arguments)})" if arguments else ""


def _negate(text: str) -> str:
    return text.removeprefix("not ") if text.startswith("not ") else f"not {text}"


def _write_fraction(number: Fraction) -> str:
    return f"{number.numerator}/{number.denominator}"
