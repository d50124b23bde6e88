"""Random programs: dynamic ranges, derived and partial attributes, circles, errors, obs and do."""

from __future__ import annotations

from dataclasses import dataclass

from hypothesis import strategies as st

SORTS = {"s": ("u", "v", "w"), "n": ("1", "2", "3"), "boolean": ("true", "false")}


@dataclass(frozen=True)
class Made:
    """An attribute: its name, the values of its range, and whether it has an argument (1 or 2)."""

    name: str
    sort: str
    indexed: bool

    @property
    def values(self) -> tuple[str, ...]:
        return SORTS[self.sort]

    @property
    def terms(self) -> list[str]:
        return [f"{self.name}({i})" for i in (1, 2)] if self.indexed else [self.name]


@dataclass(frozen=True)
class Case:
    """A program with what is to be asked of it."""

    text: str
    query: str
    inputs: tuple[str, ...]
    evidence: tuple[tuple[str, str], ...]
    do: tuple[tuple[str, str], ...]


@st.composite
def literals(draw: st.DrawFn, known: list[Made]) -> str:
    made = draw(st.sampled_from(known))
    term = f"{made.name}({draw(st.sampled_from(['1', '2', 'D']))})" if made.indexed else made.name
    value = draw(st.sampled_from(made.values))
    relation = draw(st.sampled_from(["=", "=", "=", "!=", *(["<", ">="] if made.sort == "n" else [])]))
    return f"{draw(st.sampled_from(['', '', 'not ']))}{term}{relation}{value}"


@st.composite
def statements(draw: st.DrawFn, made: Made, known: list[Made], number: int) -> list[str]:
    """What a program says of one attribute, in terms of `known` ones."""
    some = literals(known) if known else st.nothing()
    term = f"{made.name}(D)" if made.indexed else made.name
    values = st.sampled_from(made.values)

    def body(most: int, sign: str = " :- ") -> str:
        parts = draw(st.lists(some, max_size=most)) if known else []
        if not made.indexed:
            parts = [part.replace("(D)", "(1)") for part in parts]
        return f"{sign}{', '.join(parts)}" if parts else ""

    lines = []
    kind = draw(st.sampled_from(["random", "random", "random", "derived", "both"]))
    if kind != "derived":
        chosen = ""
        if known and draw(st.integers(0, 2)) == 0:
            out = f"out{number}"
            arguments = "d, " if made.indexed else ""
            lines.append(f"{out} : {arguments}{made.sort} -> boolean.")
            inside = "D, " if made.indexed else ""
            for value in draw(st.lists(values, min_size=1, max_size=2, unique=True)):
                if made.indexed:
                    lines.append(f"{out}({inside}{value}){body(2) or ' :- D=1'}.")
                else:
                    lines.append(f"{out}({value}){body(2)}.")
            chosen = f" : {{X : not {out}({inside}X)}}"
        lines.append(f"random({term}{chosen}){body(1)}.")
        for _ in range(draw(st.integers(0, 2))):
            quarter = draw(st.integers(0, 4))
            lines.append(f"pr({term}={draw(values)}{body(2, ' | ')}) = {quarter}/4.")
    if kind != "random":
        for _ in range(draw(st.integers(1, 2))):
            lines.append(f"{term}={draw(values)}{body(2)}.")
    return lines


@st.composite
def cases(draw: st.DrawFn) -> Case:
    """A program, a query with evidence for some of its inputs, and interventions."""
    made = [
        Made(f"a{i}", draw(st.sampled_from(["s", "n", "boolean"])), draw(st.integers(0, 3)) == 0)
        for i in range(draw(st.integers(1, 5)))
    ]
    lines = ["s = {u, v, w}.", "n = {1..3}.", "d = {1, 2}.", "#domain d(D)."]
    lines += [f"{m.name} : {'d -> ' if m.indexed else ''}{m.sort}." for m in made]
    circular = draw(st.integers(0, 3)) == 0
    for i, m in enumerate(made):
        lines += draw(statements(m, made if circular else made[:i], i))
    for _ in range(draw(st.sampled_from([0, 0, 0, 1]))):
        parts = draw(st.lists(literals(made), min_size=1, max_size=3))
        lines.append(f":- {', '.join(parts)}.")
    for _ in range(draw(st.sampled_from([0, 0, 0, 1]))):
        lines.append(f"obs({draw(literals(made)).replace('(D)', '(1)')}).")
    terms = [(term, m) for m in made for term in m.terms]
    some = st.sampled_from(terms)
    free = {line[7:].split(" ")[0].rstrip(").").split("(")[0] for line in lines if line.startswith("random(")}
    settable = [(term, m) for term, m in terms if m.name in free]
    do = {}
    if settable and draw(st.integers(0, 2)) == 0:
        for term, m in draw(st.lists(st.sampled_from(settable), max_size=2)):
            do[term] = draw(st.sampled_from(m.values))
    if settable and draw(st.integers(0, 9)) == 0:
        term, m = draw(st.sampled_from(settable))
        lines.append(f"do({term}={draw(st.sampled_from(m.values))}).")
    seen = dict(draw(st.lists(some, max_size=3)))
    evidence = tuple(
        (term, draw(st.sampled_from(m.values))) for term, m in seen.items() if draw(st.integers(0, 3))
    )
    query = draw(some)[0]
    return Case("\n".join(lines), query, tuple(seen), evidence, tuple(do.items()))
