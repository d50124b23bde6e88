"""Random programs about uncertain maps: rules that depend on each other in cycles, most of them linear."""

from __future__ import annotations

from hypothesis import strategies as st
from tests.reasoning.circuit.programs import Case, likelihoods


@st.composite
def maps(draw: st.DrawFn) -> Case:
    """Draw rooms, doors that may be open one way or both, and what depends on them."""
    n = draw(st.integers(2, 5))
    room = st.integers(1, n)
    values = draw(st.sampled_from([("true",), ("true",), ("a", "b", "d")]))
    sort = "boolean" if len(values) == 1 else "k"
    value = st.sampled_from(values)
    lines = [
        f"room = {{1..{n}}}. k = {{a, b, d}}. #domain room(R).",
        f"open : room, room -> boolean. reach : room -> {sort}. lamp : room -> boolean. c : boolean.",
        "random(c).",
        f"reach({draw(room)})={draw(value)}{draw(st.sampled_from(['', '', ' :- c']))}.",
    ]
    doors = set()
    for i, j in draw(st.lists(st.tuples(room, room), min_size=1, max_size=7)):
        condition = draw(
            st.sampled_from(
                ["", "open({0},{1})", "open({0},{1}), c", "not open({0},{1})=true", "open({0},{1})=false"]
            )
        )
        if condition and (i, j) not in doors:
            doors.add((i, j))
            lines.append(f"random(open({i},{j})). pr(open({i},{j})) = {draw(st.integers(1, 9))}/10.")
        condition = f", {condition.format(i, j)}" if condition else ""
        there, back = draw(value), draw(value)
        lines.append(f"reach({j})={there} :- reach({i})={back}{condition}.")
        if draw(st.booleans()):
            lines.append(f"reach({i})={back} :- reach({j})={there}{condition}.")
    both = [f"reach({draw(room)})={draw(value)}" for _ in range(2)]
    extras = [
        f"lamp(R) :- reach(R)={draw(value)}, c.",
        f"random(lamp(R)) :- reach(R)={draw(value)}.",
        f":- reach({draw(room)})={draw(value)}, not reach({draw(room)})={draw(value)}.",
        " ".join([f"reach({draw(room)})={draw(value)}", ":-", ", ".join(both), ", c."]),
    ]  # the last is not linear
    if sort == "boolean":
        extras.append("reach(R)=false :- not reach(R).")
    chosen = draw(st.lists(st.sampled_from(extras), max_size=2, unique=True))
    lines += chosen[:1] if all("lamp" in line for line in chosen) else chosen
    query = draw(st.sampled_from([f"reach({draw(room)})", f"lamp({draw(room)})", "c"]))
    observed = {f"reach({draw(room)})": draw(value)} if draw(st.booleans()) else {}
    question = f"?{{reach({draw(room)})={draw(value)}}} | obs(c)."
    domain = ("true", "false") if sort == "boolean" else values
    soft = draw(likelihoods([(f"reach({i})", domain) for i in range(1, n + 1)]))
    return Case("\n".join(lines), query, tuple(observed), tuple(observed.items()), (), question, soft)
