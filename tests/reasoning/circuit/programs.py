"""Random programs: both semantics, dynamic ranges, derived and partial attributes, records, arithmetic over
variables, labels, circles, errors, obs and do.
"""

from __future__ import annotations

from dataclasses import dataclass

from hypothesis import strategies as st

SORTS = {
    "s": ("u", "v", "w"),
    "n": ("1", "2", "3"),
    "r": ("f(u)", "f(v)", "g"),
    "boolean": ("true", "false"),
}
INDEXES = {"": (), "d": ("1", "2"), "e": ("f(u)", "g")}
VARIABLES = {"d": "D", "e": "E"}
HEADER = """\
s = {u, v, w}.
n = {1..3}.
r = {f(u), f(v), g}.
d = {1, 2}.
e = {f(u), g}.
#domain d(D), e(E)."""


@dataclass(frozen=True)
class Made:
    """An attribute: its name, the sort of its values, and that of its argument, if it has one."""

    name: str
    sort: str
    index: str

    @property
    def values(self) -> tuple[str, ...]:
        return SORTS[self.sort]

    @property
    def terms(self) -> list[str]:
        return [f"{self.name}({i})" for i in INDEXES[self.index]] if self.index else [self.name]

    @property
    def general(self) -> str:
        """The term with its variable."""
        return f"{self.name}({VARIABLES[self.index]})" if self.index else self.name

    @property
    def declaration(self) -> str:
        return f"{self.name} : {self.index + ' -> ' if self.index else ''}{self.sort}."


@dataclass(frozen=True)
class Case:
    """A program with what is to be asked of it.

    query, inputs, evidence, do: of a circuit.
    question: a conjunction with conditions, as text.
    soft: term -> the weight of each of its values.
    """

    text: str
    query: str
    inputs: tuple[str, ...]
    evidence: tuple[tuple[str, str], ...]
    do: tuple[tuple[str, str], ...]
    question: str
    soft: tuple[tuple[str, tuple[tuple[str, int], ...]], ...] = ()


@st.composite
def likelihoods(draw: st.DrawFn, terms: list[tuple[str, tuple[str, ...]]]) -> tuple:
    """Weights for the values of up to three terms, most of them not 0."""
    chosen = draw(st.lists(st.sampled_from(terms), max_size=3, unique=True))
    weight = st.sampled_from([0, 1, 1, 2, 3])
    return tuple((term, tuple((value, draw(weight)) for value in values)) for term, values in chosen)


@st.composite
def literals(draw: st.DrawFn, known: list[Made], variables: frozenset[str] = frozenset()) -> str:
    """A literal about a ground term, or one with a variable that its statement has anyway."""
    made = draw(st.sampled_from(known))
    own = [made.general] if made.index in variables else []
    term = draw(st.sampled_from([*made.terms, *own]))
    value = draw(st.sampled_from(made.values))
    relation = draw(st.sampled_from(["=", "=", "=", "!=", *(["<", ">="] if made.sort == "n" else [])]))
    return f"{draw(st.sampled_from(['', '', 'not ']))}{term}{relation}{value}"


@st.composite
def bodies(draw: st.DrawFn, known: list[Made], index: str, most: int, sign: str = " :- ") -> str:
    some = literals(known, frozenset([index]))
    parts = draw(st.lists(some, max_size=most)) if known else []
    return f"{sign}{', '.join(parts)}" if parts else ""


@st.composite
def selections(draw: st.DrawFn, made: Made, known: list[Made], number: int) -> list[str]:
    """One or two random selections of an attribute with their ranges, and its pr-atoms."""
    lines, labels = [], [""]
    for again in range(draw(st.sampled_from([1, 1, 1, 1, 1, 2]))):
        chosen = ""
        if known and draw(st.integers(0, 2)) == 0:
            name = f"in{number}{again}"
            inside = f"{VARIABLES[made.index]}, " if made.index else ""
            lines.append(f"{name} : {made.index + ', ' if made.index else ''}{made.sort} -> boolean.")
            for value in draw(st.lists(st.sampled_from(made.values), min_size=1, max_size=2, unique=True)):
                lines.append(f"{name}({inside}{value}){draw(bodies(known, made.index, 2))}.")
            negated = draw(st.sampled_from(["not ", "not ", ""]))
            other = draw(st.sampled_from(["", "", f", X != {made.values[0]}"]))
            chosen = f" : {{X : {negated}{name}({inside}X){other}}}"
        label = draw(st.sampled_from(["", "", f"l{number}{again}"]))
        if label and made.index and draw(st.booleans()):
            label += f"({VARIABLES[made.index]})"
        labels.append(label)
        shown = f"[{label}] " if label else ""
        lines.append(f"{shown}random({made.general}{chosen}){draw(bodies(known, made.index, 1))}.")
    counted = [m for m in known if m.sort == "n" and not m.index]
    for _ in range(draw(st.sampled_from([0, 1, 1, 2]))):
        label = draw(st.sampled_from(labels))
        shown = f"[{label}] " if label else ""
        value = draw(st.sampled_from(made.values))
        if counted and draw(st.integers(0, 3)) == 0:
            number_of = draw(st.sampled_from(["K/4", "1/K", "(K-1)/2", "K/6"]))
            condition, given = f" | {draw(st.sampled_from(counted)).name}=K", number_of
        else:
            condition = draw(bodies(known, made.index, 2, " | "))
            given = f"{draw(st.integers(0, 4))}/4"
        lines.append(f"{shown}pr({made.general}={value}{condition}) = {given}.")
    return lines


@st.composite
def rules(draw: st.DrawFn, made: Made, known: list[Made]) -> str:
    """A rule for an attribute; its value may be computed from that of another."""
    body = draw(bodies(known, made.index, 2))
    source = draw(st.sampled_from(known)) if known else None
    if source is None or draw(st.booleans()):
        return f"{made.general}={draw(st.sampled_from(made.values))}{body}."
    term = draw(st.sampled_from([*source.terms, *([source.general] if source.index == made.index else [])]))
    value, of = {
        ("n", "n"): (draw(st.sampled_from(["V", "V+1", "V-1", "2*V", "4-V", "V mod 2 + 1"])), "V"),
        ("r", "s"): ("f(V)", "V"),
        ("s", "r"): ("V", "f(V)"),
    }.get((made.sort, source.sort), ("V", "V") if made.sort == source.sort else (made.values[0], "_"))
    compared = (
        draw(st.sampled_from(["", "", ", V != 2", ", V < 3"])) if source.sort == "n" == made.sort else ""
    )
    return f"{made.general}={value}{body or ' :- '}{', ' if body else ''}{term}={of}{compared}."


@st.composite
def statements(draw: st.DrawFn, made: Made, known: list[Made], number: int) -> list[str]:
    """What a program says of one attribute, in terms of `known` ones."""
    kind = draw(st.sampled_from(["random", "random", "random", "derived", "both", "step"]))
    lines = []
    if kind in ("random", "both"):
        lines += draw(selections(made, known, number))
    if kind == "step" and made.index == "d":  # from each index to the next
        change = draw(st.sampled_from(["V", "V+1", "4-V"])) if made.sort == "n" else "V"
        lines.append(f"random({made.name}(1)).")
        lines.append(f"{made.name}(D+1)={change} :- {made.name}(D)=V.")
    elif kind != "random":
        lines += [draw(rules(made, known)) for _ in range(draw(st.integers(1, 2)))]
    return lines


@st.composite
def cases(draw: st.DrawFn) -> Case:
    """A program, a query with evidence for some of its inputs, and interventions."""
    made = [
        Made(
            f"a{i}",
            draw(st.sampled_from(["s", "n", "r", "boolean", "boolean"])),
            draw(st.sampled_from(["", "", "", "d", "e"])),
        )
        for i in range(draw(st.integers(1, 5)))
    ]
    lines = [f"#semantics {draw(st.sampled_from(['2009', '2018']))}.", *HEADER.split("\n")]
    lines += [m.declaration for m in made]
    circular = draw(st.integers(0, 3)) == 0
    for i, m in enumerate(made):
        lines += draw(statements(m, made if circular else made[:i], i))
    for _ in range(draw(st.sampled_from([0, 0, 0, 1]))):
        lines.append(f":- {', '.join(draw(st.lists(literals(made), min_size=1, max_size=3)))}.")
    for _ in range(draw(st.sampled_from([0, 0, 0, 1]))):
        lines.append(f"obs({draw(literals(made))}).")
    terms = [(term, m) for m in made for term in m.terms]
    some = st.sampled_from(terms)
    free = {line.partition("random(")[2].split("(")[0].split(")")[0].split(" ")[0] for line in lines}
    settable = [(term, m) for term, m in terms if m.name in free]
    do = {}
    if settable and draw(st.integers(0, 2)) == 0:
        for term, m in draw(st.lists(st.sampled_from(settable), max_size=3)):
            do[term] = draw(st.sampled_from(m.values))
    if settable and draw(st.integers(0, 9)) == 0:
        term, m = draw(st.sampled_from(settable))
        lines.append(f"do({term}={draw(st.sampled_from(m.values))}).")
    seen = dict(draw(st.lists(some, max_size=3)))
    evidence = tuple(
        (term, draw(st.sampled_from(m.values))) for term, m in seen.items() if draw(st.integers(0, 3))
    )
    query = draw(some)[0]
    asked = ", ".join(draw(st.lists(literals(made), min_size=1, max_size=3)))
    conditions = [f"obs({literal})" for literal in draw(st.lists(literals(made), max_size=2))]
    conditions += [f"do({term}={value})" for term, value in do.items()]
    question = f"?{{{asked}}}{' | ' if conditions else ''}{', '.join(conditions)}"
    soft = draw(likelihoods([(term, m.values) for term, m in terms]))
    return Case("\n".join(lines), query, tuple(seen), evidence, tuple(do.items()), question, soft)
