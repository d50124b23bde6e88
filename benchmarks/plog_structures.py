"""Families of P-log programs that are not chains: trees, noisy-or networks, uncertain maps, assignments.

As in `plog_families`, each has its text in several languages and its exact answer, computed in another way.
"""

from __future__ import annotations

from collections.abc import Iterable
from itertools import product

from plog_families import Case

NOT = "\\+"
"""Negation in ProbLog."""


def tree(depth: int) -> Case:
    """A binary tree of booleans, all leaves observed; P(the root)."""
    n, first = 2 ** (depth + 1) - 1, 2**depth
    seen = {leaf: leaf % 3 != 0 for leaf in range(first, n + 1)}
    p = {
        (side, parent): q
        for side, parent, q in ((0, True, 0.9), (0, False, 0.2), (1, True, 0.7), (1, False, 0.1))
    }
    below = {leaf: {True: float(value), False: float(not value)} for leaf, value in seen.items()}
    for node in range(first - 1, 0, -1):
        below[node] = {
            value: sum_product(p[0, value], below[2 * node]) * sum_product(p[1, value], below[2 * node + 1])
            for value in (True, False)
        }
        scale = sum(below[node].values())
        below[node] = {value: weight / scale for value, weight in below[node].items()}
    weights = {True: 0.3 * below[1][True], False: 0.7 * below[1][False]}
    rules = "".join(
        f"[r(N)] pr(x(N) | x(P) = {str(value).lower()}, N = 2*P+{side}) = {q}.\n"
        for (side, value), q in p.items()
    )
    observed = ", ".join(f"obs(x({leaf}) = {str(value).lower()})" for leaf, value in seen.items())
    problog = "".join(
        f"{q}::x({2 * node + side}) :- {'' if value else NOT}x({node}).\n"
        for node in range(1, first)
        for (side, value), q in p.items()
    )
    evidence = "".join(f"evidence({'' if value else NOT}x({leaf})).\n" for leaf, value in seen.items())
    texts = {
        "lcorpp": f"node = {{1..{n}}}.\n#domain node(N;P).\nx : node -> boolean.\n[r(N)] random(x(N)).\n"
        f"[r(1)] pr(x(1)) = 3/10.\n{rules}?{{x(1)}} | {observed}.\n",
        "problog": f"0.3::x(1).\n{problog}{evidence}query(x(1)).\n",
    }
    return Case(texts, weights[True] / sum(weights.values()))


def sum_product(p: float, below: dict[bool, float]) -> float:
    return p * below[True] + (1 - p) * below[False]


def noisy_or(n: int) -> Case:
    """A ring of n diseases and n symptoms with two possible causes each; P(disease 1 | all symptoms)."""
    prior, cause, leak = 0.1, 0.7, 0.05
    weights = {False: 0.0, True: 0.0}
    for start in (False, True):  # around the ring, by the state of the last disease
        current = {start: prior if start else 1 - prior}
        for i in range(1, n + 1):
            following = {False: 0.0, True: 0.0}
            for ill, weight in current.items():
                for after in (False, True) if i < n else (start,):
                    shown = 1 - (1 - leak) * (1 - cause) ** (ill + after)
                    chance = 1.0 if i == n else (prior if after else 1 - prior)
                    following[after] += weight * shown * chance
            current = following
        weights[start] = current[start]
    links = [(i, j) for i in range(1, n + 1) for j in (i, i % n + 1)]
    observed = ", ".join(f"obs(s({i}))" for i in range(1, n + 1))
    texts = {
        "lcorpp": f"d = {{1..{n}}}.\n#domain d(I;J).\nill, s, leak : d -> boolean.\n"
        "link, cause : d, d -> boolean.\n"
        + " ".join(f"link({i},{j})." for i, j in links)
        + f"\n[a(I)] random(ill(I)).\n[a(I)] pr(ill(I)) = {prior}.\n"
        f"[b(I,J)] random(cause(I,J)) :- link(I,J).\n[b(I,J)] pr(cause(I,J)) = {cause}.\n"
        f"[c(I)] random(leak(I)).\n[c(I)] pr(leak(I)) = {leak}.\n"
        f"s(I) :- ill(J), cause(I,J), link(I,J).\ns(I) :- leak(I).\n?{{ill(1)}} | {observed}.\n",
        "problog": "".join(
            f"{prior}::ill({i}). {leak}::leak({i}). s({i}) :- leak({i}).\n" for i in range(1, n + 1)
        )
        + "".join(f"{cause}::cause({i},{j}). s({i}) :- ill({j}), cause({i},{j}).\n" for i, j in links)
        + "".join(f"evidence(s({i})).\n" for i in range(1, n + 1))
        + "query(ill(1)).\n",
    }
    return Case(texts, weights[True] / sum(weights.values()))


def corridor(n: int) -> Case:
    """n rooms in a row with doors that are open with 9/10, both ways; P(the last is reached)."""
    return make_map([(i, i + 1) for i in range(1, n)], n, 0.9 ** (n - 1))


def rooms(rows: int, columns: int) -> Case:
    """A grid of rooms with such doors; P(the opposite corner is reached)."""
    number = {place: i + 1 for i, place in enumerate(product(range(rows), range(columns)))}
    doors = [
        (number[i, j], number[place])
        for i, j in number
        for place in ((i, j + 1), (i + 1, j))
        if place in number
    ]
    return make_map(doors, rows * columns, compute_reliability(doors, 0.9, rows * columns))


def compute_reliability(doors: list[tuple[int, int]], p: float, last: int) -> float:
    """Compute the probability that open doors connect room 1 to the last.

    Source: the frontier method, Hardy, Lucet and Limnios, IEEE Trans. Reliability 56, 2007: a state is a
    partition of the vertices with undecided edges.
    """
    states = {frozenset([frozenset([1]), frozenset([last])]): 1.0}
    for number, (a, b) in enumerate(doors):
        needed = {1, last}.union(*doors[number + 1 :]) if number + 1 < len(doors) else {1, last}
        following: dict[frozenset[frozenset[int]], float] = {}
        for blocks, weight in states.items():
            known = blocks | {
                frozenset([room]) for room in (a, b) if not any(room in block for block in blocks)
            }
            joined = frozenset().union(*[block for block in known if a in block or b in block])
            opened = {block for block in known if not block & joined} | {joined}
            for own, q in ((opened, p), (known, 1 - p)):
                kept = frozenset([frozenset(block & needed) for block in own if block & needed])
                following[kept] = following.get(kept, 0.0) + weight * q
        states = following
    return sum(weight for blocks, weight in states.items() if any({1, last} <= block for block in blocks))


def make_map(doors: Iterable[tuple[int, int]], last: int, answer: float) -> Case:
    """A map of doors, and whether its last room can be reached from room 1."""
    doors = list(doors)
    texts = {
        "lcorpp": f"room = {{1..{last}}}.\n#domain room(R;Q).\ndoor, open : room, room -> boolean.\n"
        "reach : room -> boolean.\n" + " ".join(f"door({a},{b})." for a, b in doors) + "\n"
        "[o(R,Q)] random(open(R,Q)) :- door(R,Q).\n[o(R,Q)] pr(open(R,Q)) = 9/10.\nreach(1).\n"
        "reach(Q) :- reach(R), open(R,Q), door(R,Q).\nreach(R) :- reach(Q), open(R,Q), door(R,Q).\n"
        f"?{{reach({last})}}.\n",
        "problog": "".join(f"0.9::open({a},{b}).\n" for a, b in doors)
        + "reach(1).\nreach(Q) :- open(R,Q), reach(R).\nreach(R) :- open(R,Q), reach(Q).\n"
        + f"query(reach({last})).\n",
    }
    return Case(texts, answer)


def assignment(n: int) -> Case:
    """n objects at n places, no two at the same one; P(the last object is at place 1)."""
    texts = {
        "lcorpp": f"object = {{1..{n}}}.\nplace = {{1..{n}}}.\n#domain object(A;B).\n#domain place(X).\n"
        "at : object -> place.\n"
        f"[r(A)] random(at(A)).\n:- at(A) = X, at(B) = X, A < B.\n?{{at({n}) = 1}}.\n",
        "problog": "".join(
            "; ".join(f"1/{n}::at({a},{x})" for x in range(1, n + 1)) + ".\n" for a in range(1, n + 1)
        )
        + f"clash :- at(A,X), at(B,X), A < B.\nevidence(\\+clash).\nquery(at({n},1)).\n",
    }
    return Case(texts, 1 / n)
