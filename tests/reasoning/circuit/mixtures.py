"""Random programs of tables and logic: a network, recursions that read it, and variables that read these."""

from __future__ import annotations

from itertools import product

from hypothesis import strategies as st
from tests.reasoning.circuit.programs import Case, likelihoods

COLOURS = ("red", "green", "blue")
TRUTHS = ("true", "false")
PAIRS = ((1, 2), (1, 3), (1, 4), (2, 3), (2, 4), (3, 4))


@st.composite
def mixtures(draw: st.DrawFn) -> Case:
    """Draw a network of up to five variables, one or two maps, constraints and what depends on both."""
    n = draw(st.integers(2, 5))
    sorts = draw(st.lists(st.sampled_from([TRUTHS, TRUTHS, COLOURS]), min_size=n, max_size=n))
    lines = ["colour = {red, green, blue}. room = {1..4}."]
    for i, values in enumerate(sorts):
        parents = draw(st.lists(st.sampled_from(range(i)), max_size=2, unique=True)) if i else []
        lines += declare(draw, f"x{i}", values, [(f"x{parent}", sorts[parent]) for parent in parents])
    literal = st.builds(
        lambda i, k, sign: f"{sign}x{i}={sorts[i][k % len(sorts[i])]}",
        st.integers(0, n - 1),
        st.integers(0, 2),
        st.sampled_from(["", "", "not "]),
    )
    room = st.integers(1, 4)
    reached = [f"m{k}" for k in range(draw(st.integers(1, 2)))]
    for name in reached:
        lines.append(f"{name}, {name}_door : room -> boolean. {name}({draw(room)}).")
        for r in sorted(draw(st.sets(room, max_size=2))):
            lines.append(f"random({name}_door({r})). pr({name}_door({r})) = {draw(st.integers(1, 9))}/10.")
        for a, b in draw(st.lists(st.sampled_from(PAIRS), min_size=3, max_size=6, unique=True)):
            condition = draw(st.one_of(literal, st.just(f"{name}_door({a})"), st.just("")))
            condition = f", {condition}" if condition else ""
            lines.append(f"{name}({b}) :- {name}({a}){condition}.")
            if draw(st.integers(0, 3)):
                lines.append(f"{name}({a}) :- {name}({b}){condition}.")
        if draw(st.booleans()):
            lines.append(f"{name}(R) = false :- not {name}(R), room(R).")
    atom = st.builds(
        lambda name, r, sign: f"{sign}{name}({r})",
        st.sampled_from(reached),
        room,
        st.sampled_from(["", "not "]),
    )
    lines.append("y, z : boolean. random(y). random(z).")
    lines += [f"pr(y | {draw(atom)}) = {draw(st.integers(0, 4))}/4.", f"pr(z | {draw(literal)}, y) = 1/3."]
    if draw(st.booleans()):
        lines.append(f":- {draw(atom)}, {draw(literal)}, {draw(atom)}.")
    if draw(st.booleans()):
        lines.append(f":- {draw(literal)}, {draw(literal)}.")
    terms = [(f"x{i}", values) for i, values in enumerate(sorts)] + [("y", TRUTHS), ("z", TRUTHS)]
    terms += [(f"{name}({r})", TRUTHS) for name in reached for r in range(1, 5)]
    query = draw(st.sampled_from([*[name for name, _ in terms], "?x0, z", f"?y, {reached[0]}(2)"]))
    seen = draw(st.lists(st.sampled_from(terms), max_size=2, unique=True))
    evidence = tuple((name, draw(st.sampled_from(values))) for name, values in seen)
    do = (("y", "true"),) if draw(st.integers(0, 5)) == 0 else ()
    evidence = tuple(pair for pair in evidence if not do or pair[0] != "y")
    inputs = tuple(name for name, _ in evidence)
    question = f"?{{{draw(atom)}, {draw(literal)}}} | obs(z)."
    return Case("\n".join(lines), query, inputs, evidence, do, question, draw(likelihoods(terms)))


def declare(draw: st.DrawFn, name: str, values: tuple[str, ...], parents: list) -> list[str]:
    """Declare a random variable, with a probability for its first value given each outcome of its parents."""
    lines = [f"{name} : {'boolean' if values == TRUTHS else 'colour'}. random({name})."]
    for row in product(*[own for _, own in parents]):
        body = ", ".join([f"{parent}={value}" for (parent, _), value in zip(parents, row, strict=True)])
        number = draw(st.sampled_from(["0", "1/5", "1/2", "2/3", "1"]))
        lines.append(f"pr({name}={values[0]}{f' | {body}' if body else ''}) = {number}.")
    return lines
