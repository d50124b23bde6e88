"""Random trees of attributes: each depends on its parent alone, so that branches are independent given it."""

from __future__ import annotations

from hypothesis import strategies as st
from tests.reasoning.circuit.programs import Case, likelihoods


@st.composite
def trees(draw: st.DrawFn) -> Case:
    """Draw a tree, with nodes that copy their parents, sensors, and pr-atoms of 0 and 1."""
    n = draw(st.integers(2, 6))
    number = st.sampled_from(["0", "1", "1/2", "1/10", "3/4"])
    lines = [
        f"i = {{1..{n}}}. leaf = {{1, {n}}}. #domain leaf(I). v : i -> boolean. w : leaf -> boolean.",
        f"random(v(1)). pr(v(1)) = {draw(number)}.",
    ]
    for node in range(2, n + 1):
        parent = draw(st.integers(1, node - 1))
        kind = draw(st.sampled_from(["random", "random", "random", "partial", "copy", "opposite"]))
        if kind in ("random", "partial"):
            lines.append(f"random(v({node})){f' :- v({parent})' if kind == 'partial' else ''}.")
            lines.append(f"pr(v({node}) | v({parent})) = {draw(number)}.")
            if draw(st.booleans()):
                lines.append(f"pr(v({node}) | not v({parent})) = {draw(number)}.")
        else:
            value = {"copy": ("V", "V"), "opposite": ("true", "false")}[kind]
            lines.append(f"v({node})={value[0]} :- v({parent})={value[1]}.")
    sensors = ["random(w(I)). pr(w(I) | v(I)) = 9/10.", "random(w(I)) :- v(I).", "w(I) :- v(I), I > 1.", ""]
    lines.append(draw(st.sampled_from(sensors)))
    terms = ["w(1)", f"w({n})", *(f"v({node})" for node in range(1, n + 1))]
    term = st.sampled_from(terms)
    literal = st.builds(
        "{}{}={}".format, st.sampled_from(["", "not "]), term, st.sampled_from(["true", "false"])
    )
    if draw(st.booleans()):
        lines.append(f":- {draw(literal)}, {draw(literal)}.")
    observed = draw(st.dictionaries(term, st.sampled_from(["true", "false"]), max_size=3))
    question = f"?{{{draw(literal)}}} | obs({draw(literal)})"
    soft = draw(likelihoods([(name, ("true", "false")) for name in terms]))
    return Case("\n".join(lines), draw(term), tuple(observed), tuple(observed.items()), (), question, soft)
