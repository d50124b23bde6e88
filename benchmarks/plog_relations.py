"""Families of relational programs on random graphs, in ProbLog, which lcorpp reads, too.

There is no formula for their answers; the answers of the engines are compared with each other.
"""

from __future__ import annotations

from collections.abc import Iterable
from itertools import product
from random import Random

from plog_families import Case

NOT = "\\+"
"""Negation in ProbLog."""


def smokers(n: int) -> Case:
    """n people, 2 n friendships that may pass smoking on, one way; P(one smokes | three others)."""
    random = Random(n)
    people = range(1, n + 1)
    pairs = [(a, b) for a in people for b in people if a != b]
    friends = sorted(random.sample(pairs, 2 * n))
    asked, *seen = random.sample(people, 4)
    return make_case(
        [f"friend({a},{b})." for a, b in friends],
        [f"person({a})." for a in people],
        "0.3::stress(X) :- person(X). 0.2::influences(X,Y) :- friend(Y,X).",
        "smokes(X) :- stress(X). smokes(X) :- friend(X,Y), influences(Y,X), smokes(Y).",
        "0.4::asthma(X) :- smokes(X).",
        [f"evidence({'' if i % 2 else NOT}smokes({a}))." for i, a in enumerate(seen)],
        f"query(smokes({asked})).",
    )


def contagion(n: int) -> Case:
    """n people in a circle with contacts to four others each, both ways, and shortcuts; some are tested."""
    random = Random(n)
    people = range(n)
    contacts = {tuple(sorted((i, (i + step) % n))) for i in people for step in (1, 2)}
    contacts.update([tuple(sorted(random.sample(people, 2))) for _ in range(n // 6)])
    tested = random.sample(people, n // 4)
    return make_case(
        [f"0.35::contact({a},{b})." for a, b in sorted(contacts)],
        [f"person({i}). 0.05::seed({i})." for i in people],
        "ill(X) :- seed(X). ill(Y) :- contact(X,Y), ill(X). ill(X) :- contact(X,Y), ill(Y).",
        f"0.9::positive(X) :- ill(X). 0.05::positive(X) :- person(X), {NOT}ill(X).",
        [f"evidence({'' if i % 3 == 0 else NOT}positive({i}))." for i in tested],
        f"query(ill({n // 2})).",
    )


def supplies(n: int) -> Case:
    """n layers of six plants, which are intact and get supplies on one of two lines from the layer before."""
    random = Random(n)
    lines = [
        (layer, plant, source)
        for layer in range(1, n)
        for plant in range(6)
        for source in sorted(random.sample(range(6), 2))
    ]
    return make_case(
        [f"0.95::intact({layer},{plant})." for layer in range(n) for plant in range(6)],
        [f"0.9::line({layer},{plant},{source})." for layer, plant, source in lines],
        "works(0,P) :- intact(0,P).",
        "works(L,P) :- line(L,P,S), L > 0, intact(L,P), K is L-1, works(K,S).",
        f"evidence({NOT}works({n - 1},0)). query(works({n - 1},1)).",
    )


def courses(n: int) -> Case:
    """n courses, each after two earlier ones; who passes both passes with 93/100, others with 3/10."""
    random = Random(n)
    before = {c: sorted(random.sample(range(max(0, c - 8), c), 2)) for c in range(2, n)}
    passed = random.sample(range(2, n - 1), n // 5)
    return make_case(
        [f"after({c},{a},{b})." for c, (a, b) in before.items()],
        [f"course({c}). 0.9::learns({c}). 0.3::guesses({c})." for c in range(n)],
        "0.7::pass(0). 0.6::pass(1).",
        "pass(C) :- after(C,A,B), pass(A), pass(B), learns(C). pass(C) :- after(C,_,_), guesses(C).",
        [f"evidence({'' if c % 2 else NOT}pass({c}))." for c in passed],
        f"query(pass({n - 1})).",
    )


def rumours(n: int) -> Case:
    """A rumour among n people with 3 n / 2 acquaintances, of whom sceptics believe nothing."""
    random = Random(n)
    people = range(n)
    pairs = [(a, b) for a in people for b in people if a < b]
    known = sorted(random.sample(pairs, 3 * n // 2))
    asked, *seen = random.sample(range(1, n), 4)
    return make_case(
        [f"knows({a},{b})." for a, b in known],
        [f"person({a})." for a in people],
        "knows2(X,Y) :- knows(X,Y). knows2(X,Y) :- knows(Y,X).",
        "0.4::tells(X,Y) :- knows2(X,Y). 0.3::sceptic(X) :- person(X).",
        "hears(0). hears(Y) :- knows2(X,Y), tells(X,Y), believes(X).",
        f"believes(X) :- hears(X), {NOT}sceptic(X).",
        [f"evidence({'' if i else NOT}believes({a}))." for i, a in enumerate(seen)],
        f"query(believes({asked})).",
    )


def outages(n: int) -> Case:
    """A power grid of n x n cells, each depending on two others, whose outages lock doors of 4 x 4 rooms."""
    random = Random(n)
    lines = []
    for i in range(n):
        for j in range(n):
            above = [f"off({i - 1},{j})"] * (i > 0) + [f"off({i},{j - 1})"] * (j > 0)
            for signs in product(("", NOT), repeat=len(above)):
                body = ", ".join([sign + cell for sign, cell in zip(signs, above, strict=True)])
                lines.append(f"{random.randint(1, 9) / 10}::off({i},{j}){f' :- {body}' if body else ''}.")
    doors = [((i, j), other) for i in range(4) for j in range(4) for other in ((i, j + 1), (i + 1, j))]
    doors = [(a, b) for a, b in doors if max(b) < 4]
    cells = [(random.randrange(n), random.randrange(n)) for _ in range(4)]
    locked = random.sample(doors, 4)
    return make_case(
        lines,
        [f"door(r{a}{b},r{c}{d})." for (a, b), (c, d) in doors],
        [
            f"locked(r{a}{b},r{c}{d}) :- off({i},{j})."
            for ((a, b), (c, d)), (i, j) in zip(locked, cells, strict=True)
        ],
        f"0.7::opens(X,Y) :- door(X,Y). passable(X,Y) :- opens(X,Y), {NOT}locked(X,Y).",
        "reach(r00). reach(Y) :- passable(X,Y), reach(X). reach(X) :- passable(X,Y), reach(Y).",
        f"evidence(off({n - 1},{n // 2})). evidence({NOT}off({n // 2},{n - 1})). evidence({NOT}reach(r03)).",
        "query(reach(r33)).",
    )


def make_case(*parts: str | Iterable[str]) -> Case:
    """Join lines, and lists of lines, to a program."""
    lines = [part if isinstance(part, str) else "\n".join(part) for part in parts]
    text = "\n".join([*lines, ""])
    return Case({"lcorpp": text, "problog": text}, float("nan"))
