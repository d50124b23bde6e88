"""The programs of the P-log benchmark: each family at any size, in four languages, with its exact answer.

The languages are plog 1.0 (which lcorpp reads), plog 2.0, plingo and ProbLog. The texts of a family are
equivalent, in the idiom of each language, after the public descriptions in the P-log papers and examples.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from itertools import combinations
from math import comb


@dataclass(frozen=True)
class Case:
    """A program and its query.

    texts: "lcorpp", "plog2", "plingo", "problog" -> the program with the query.
    answer: the probability that the query asks for; NaN if there is no formula.
    query, inputs: the term to compile for, with its value, and the terms that evidence may name; without
        inputs the family is measured from its text only.
    evidences: evidence for all inputs, with the answers.
    """

    texts: Mapping[str, str]
    answer: float
    query: tuple[str, str] = ("", "")
    inputs: tuple[str, ...] = ()
    evidences: tuple[tuple[Mapping[str, str], float], ...] = ()


def chain(n: int) -> Case:
    """A Markov chain x(0..n) of booleans; P(x(n)), as it is and given x(0)."""
    ends = {"true": 1.0, "false": 0.0}
    for start, p in ends.items():
        for _ in range(n):
            p = 0.9 * p + 0.2 * (1 - p)
        ends[start] = p
    texts = {
        "lcorpp": f"time = {{0..{n}}}.\n#domain time(T;T1).\nx : time -> boolean.\n[x(T)] random(x(T)).\n"
        "[x(0)] pr(x(0)) = 1/2.\n[x(T1)] pr(x(T1) | x(T), T1 = T + 1) = 9/10.\n"
        f"[x(T1)] pr(x(T1) | x(T) = false, T1 = T + 1) = 2/10.\n?{{x({n})}}.\n",
        "plog2": f"sorts\n#time = 0..{n}. #boolean = {{true, false}}.\nattributes\nx : #time -> #boolean.\n"
        "statements\nrandom(x(T)).\npr(x(0)) = 1/2.\npr(x(T1) | x(T), T1 = T + 1) = 9/10.\n"
        f"pr(x(T1) | x(T) = false, T1 = T + 1) = 2/10.\n?x({n}).\n",
        "plingo": f"time(0..{n}). bool(t;f).\n&random(e(T)) {{ x(T,B) : bool(B) }} :- time(T).\n"
        '&pr(e(0)) { x(0,t) } = "0.5".\n&pr(e(T)) { x(T,t) } = "0.9" :- x(T-1,t), time(T).\n'
        f'&pr(e(T)) {{ x(T,t) }} = "0.2" :- x(T-1,f), time(T).\n&query(x({n},t)).\n',
        "problog": "0.5::x(0).\n"
        + "".join(f"0.9::x({i}) :- x({i - 1}).\n0.2::x({i}) :- \\+x({i - 1}).\n" for i in range(1, n + 1))
        + f"query(x({n})).\n",
    }
    evidences = tuple(({"x(0)": value}, p) for value, p in ends.items())
    return Case(texts, sum(ends.values()) / 2, (f"x({n})", "true"), ("x(0)",), evidences)


def dice(n: int) -> Case:
    """Mike's dice, the odd ones, show six with 1/4, John's are fair; P(the first is a six | one is)."""
    owners = {d: "mike" if d % 2 else "john" for d in range(1, n + 1)}
    owned = " ".join(f"owner({d}) = {who}." for d, who in owners.items())
    rules = "some_six :- roll(D) = 6.\nsome_six = false :- not some_six.\n"
    faces = {
        "mike": "; ".join([*(f"3/20::roll(%d,{x})" for x in range(1, 6)), "1/4::roll(%d,6)"]),
        "john": "; ".join(f"1/6::roll(%d,{x})" for x in range(1, 7)),
    }
    texts = {
        "lcorpp": f"die = {{1..{n}}}.\nscore = {{1..6}}.\nperson = {{mike, john}}.\n#domain die(D).\n"
        "roll : die -> score.\nowner : die -> person.\nsome_six : boolean.\n"
        f"{owned}\n[r(D)] random(roll(D)).\n[r(D)] pr(roll(D) = 6 | owner(D) = mike) = 1/4.\n{rules}"
        "?{roll(1) = 6} | obs(some_six).\n",
        "plog2": f"sorts\n#die = 1..{n}. #score = 1..6. #person = {{mike, john}}.\n"
        "#boolean = {true, false}.\nattributes\nroll : #die -> #score.\n"
        "owner : #die -> #person. some_six : #boolean.\n"
        f"statements\n{owned}\nrandom(roll(D)).\npr(roll(D) = 6 | owner(D) = mike) = 1/4.\n{rules}"
        "obs(some_six, true).\n?roll(1) = 6.\n",
        "plingo": f"die(1..{n}). score(1..6). owner(D,mike) :- die(D), D\\2 = 1.\n"
        "&random(r(D)) { roll(D,X) : score(X) } :- die(D).\n"
        '&pr(r(D)) { roll(D,6) } = "1/4" :- owner(D,mike).\n'
        "some_six :- roll(D,6).\n:- not some_six.\n&query(roll(1,6)).\n",
        "problog": "".join(faces[who].replace("%d", str(d)) + ".\n" for d, who in owners.items())
        + "some_six :- roll(_,6).\nevidence(some_six).\nquery(roll(1,6)).\n",
    }
    none = 0.75 ** ((n + 1) // 2) * (5 / 6) ** (n // 2)
    return Case(texts, 0.25 / (1 - none))


def dice_sum(n: int) -> Case:
    """P(n fair dice show 7n/2 together)."""
    total = 7 * n // 2
    ways = {0: 1}
    for _ in range(n):
        ways = {s: sum(ways.get(s - r, 0) for r in range(1, 7)) for s in range(1, 6 * n + 1)}
    rules = "total(0) = 0.\ntotal(C1) = S1 :- total(C) = S, roll(C1) = R, C1 = C + 1, S1 = S + R.\n"
    texts = {
        "lcorpp": f"die = {{1..{n}}}.\nscore = {{1..6}}.\ncount = {{0..{n}}}.\nsum = {{0..{6 * n}}}.\n"
        "#domain die(D).\n#domain count(C;C1).\n#domain score(R).\n#domain sum(S;S1).\n"
        "roll : die -> score.\ntotal : count -> sum.\n[r(D)] random(roll(D)).\n"
        f"{rules}?{{total({n}) = {total}}}.\n",
        "plog2": f"sorts\n#die = 1..{n}. #score = 1..6. #count = 0..{n}. #sum = 0..{6 * n}.\nattributes\n"
        f"roll : #die -> #score. total : #count -> #sum.\nstatements\nrandom(roll(D)).\n{rules}"
        f"?total({n}) = {total}.\n",
        "plingo": f"die(1..{n}). score(1..6).\n&random(r(D)) {{ roll(D,X) : score(X) }} :- die(D).\n"
        f"total(0,0).\ntotal(D,S+R) :- total(D-1,S), roll(D,R).\n&query(total({n},{total})).\n",
        "problog": "".join(
            "; ".join(f"1/6::roll({d},{x})" for x in range(1, 7)) + ".\n" for d in range(1, n + 1)
        )
        + "total(0,0).\ntotal(D,S) :- D > 0, D0 is D-1, roll(D,R), total(D0,S0), S is S0+R.\n"
        + f"query(total({n},{total})).\n",
    }
    return Case(texts, float(Fraction(ways[total], 6**n)))


def squirrel(days: int) -> Case:
    """P(acorns found on the last day | not on those before), looking always where they likelier are."""
    before = range(1, days)
    texts = {
        "lcorpp": f"patch = {{p1, p2}}.\nday = {{1..{days}}}.\n#domain day(D).\n#domain patch(P).\n"
        "hidden_in : patch.\nfound : day -> boolean.\nlook : day -> patch.\n[r1] random(hidden_in).\n"
        f"[r2(D)] random(found(D)) :- hidden_in = P, look(D) = P.\n"
        "found(D) = false :- not found(D).\nlook(D) = p1.\n"
        f"[r1] pr(hidden_in = p1) = 8/10.\n[r2(D)] pr(found(D)) = 2/10.\n?{{found({days})}}"
        + (" | " + ", ".join(f"obs(found({i}) = false)" for i in before) if days > 1 else "")
        + ".\n",
        "plog2": f"sorts\n#patch = {{p1, p2}}. #day = 1..{days}. #boolean = {{true, false}}.\nattributes\n"
        "hidden_in : #patch. found : #day -> #boolean. look : #day -> #patch.\nstatements\n"
        f"random(hidden_in).\nrandom(found(D)) :- hidden_in = P, look(D) = P.\n"
        "found(D) = false :- hidden_in = P1, look(D) = P2, P1 != P2.\nlook(D) = p1.\n"
        "pr(hidden_in = p1) = 8/10.\npr(found(D)) = 2/10.\n"
        + "".join(f"obs(found({i}), false).\n" for i in before)
        + f"?found({days}).\n",
        "plingo": f"patch(p1;p2). boolean(t;f). day(1..{days}). look(D,p1) :- day(D).\n"
        "found(D,f) :- not found(D,t), day(D).\n&random { hidden_in(P) : patch(P) }.\n"
        "&random { found(D,B) : boolean(B) } :- hidden_in(P), look(D,P).\n"
        '&pr { hidden_in(p1) } = "0.8".\n&pr { found(D,t) } = "0.2" :- day(D).\n'
        f"&obs {{ found(D,f) }} :- day(D), D < {days}.\n&query(found({days},t)).\n",
        "problog": "0.8::in_p1.\n"
        + "".join(f"0.2::luck({i}). found({i}) :- in_p1, luck({i}).\n" for i in range(1, days + 1))
        + "".join(f"evidence(found({i}),false).\n" for i in before)
        + f"query(found({days})).\n",
    }
    here = 0.8 * 0.8 ** (days - 1)
    return Case(texts, 0.2 * here / (here + 0.2))


def robot(steps: int, rooms: int = 0) -> Case:
    """A robot goes along a line; P(it is where nine of ten steps lead), or P(it reached the last room).

    rooms: 0 for an infinite line and steps that succeed with 9/10; otherwise the number of rooms, with steps
        that succeed with 1/50, so that the position stays uncertain.
    """
    last = rooms - 1 if rooms else steps
    goal = last if rooms else 9 * steps // 10
    p = Fraction(1, 50) if rooms else Fraction(9, 10)
    stays = f"at(T1) = {last} :- at(T) = {last}, moved(T1), T1 = T + 1.\n" if rooms else ""
    rules = (
        "at(0) = 0.\nat(T1) = Y :- at(T) = X, moved(T1), T1 = T + 1, Y = X + 1.\n"
        f"at(T1) = X :- at(T) = X, moved(T1) = false, T1 = T + 1.\n{stays}"
    )
    texts = {
        "lcorpp": f"step = {{1..{steps}}}.\ntime = {{0..{steps}}}.\nplace = {{0..{last}}}.\n"
        "#domain step(S).\n#domain time(T;T1).\n#domain place(X;Y).\nat : time -> place.\n"
        "moved : step -> boolean.\n"
        f"[m(S)] random(moved(S)).\n[m(S)] pr(moved(S)) = {p}.\n{rules}?{{at({steps}) = {goal}}}.\n",
        "plog2": f"sorts\n#step = 1..{steps}. #time = 0..{steps}. #place = 0..{last}.\n"
        "#boolean = {true, false}.\nattributes\nat : #time -> #place. moved : #step -> #boolean.\n"
        "statements\nrandom(moved(S)).\n"
        f"pr(moved(S)) = {p}.\n{rules}?at({steps}) = {goal}.\n",
        "plingo": f"step(1..{steps}). bool(t;f).\n&random(m(S)) {{ moved(S,B) : bool(B) }} :- step(S).\n"
        f'&pr(m(S)) {{ moved(S,t) }} = "{p}" :- step(S).\nat(0,0).\n'
        f"at(T+1,X+1) :- at(T,X), moved(T+1,t), X < {last}.\nat(T+1,X) :- at(T,X), moved(T+1,f).\n"
        f"at(T+1,{last}) :- at(T,{last}), moved(T+1,t).\n&query(at({steps},{goal})).\n",
        "problog": "".join(f"{p}::moved({i}).\n" for i in range(1, steps + 1))
        + f"at(0,0).\nat(T1,Y) :- T1 > 0, T is T1-1, moved(T1), at(T,X), X < {last}, Y is X+1.\n"
        + "at(T1,X) :- T1 > 0, T is T1-1, \\+moved(T1), at(T,X).\n"
        + f"at(T1,{last}) :- T1 > 0, T is T1-1, moved(T1), at(T,{last}).\nquery(at({steps},{goal})).\n",
    }
    counts = range(goal) if rooms else (goal,)
    found = sum(comb(steps, k) * p**k * (1 - p) ** (steps - k) for k in counts)
    return Case(texts, float(1 - found if rooms else found))


ROWS = 4
LEFT = tuple((5 * r + c, 5 * r + c + 1) for r in range(ROWS) for c in range(1, 5))
BELOW = tuple((5 * r + c, 5 * r + c + 5) for r in range(ROWS - 1) for c in (2, 3, 4))


def blocks(n: int) -> Case:
    """P(one can walk from place 1 to 20 on Zhu's map of 20 places | n blocks lie on different places)."""
    grid = " ".join([*(f"leftof({a},{b})." for a, b in LEFT), *(f"belowof({a},{b})." for a, b in BELOW)])
    edges = " ".join(f"edge({a},{b})." for a, b in LEFT + BELOW)
    rules = (
        "invalid :- place(B1) = L1, place(B2) = L2, B1 < B2, L1 <= L2.\ninvalid = false :- not invalid.\n"
        "connected(L1,L2) :- connected(L2,L1), L1 <> L2.\n"
        "connected(L1,L3) :- connected(L1,L2), connected(L2,L3), L1 <> L3.\n"
        "connected(L1,L2) :- leftof(L1,L2), not blocked(L1), not blocked(L2).\n"
        "connected(L1,L2) :- belowof(L1,L2), not blocked(L1), not blocked(L2).\n"
        "connected(L1,L2) = false :- not connected(L1,L2).\nblocked(L1) :- place(B) = L1.\n"
    )
    texts = {
        "lcorpp": f"#domain location(L;L1;L2;L3).\n#domain block(B;B1;B2).\nlocation = {{1..20}}.\n"
        f"block = {{1..{n}}}.\nplace : block -> location.\nleftof : location, location -> boolean.\n"
        "belowof : location, location -> boolean.\nconnected : location, location -> boolean.\n"
        f"blocked : location -> boolean.\ninvalid : boolean.\n{grid}\n[r(B)] random(place(B)).\n{rules}"
        "?{connected(1,20)} | obs(invalid = false).\n",
        "plog2": f"sorts\n#location = 1..20. #block = 1..{n}. #boolean = {{true, false}}.\nattributes\n"
        "place : #block -> #location. blocked : #location -> #boolean. invalid : #boolean.\n"
        + "".join(f"{a} : #location, #location -> #boolean.\n" for a in ("leftof", "belowof", "connected"))
        + f"statements\n{grid}\nrandom(place(B)).\n"
        + rules.replace("<>", "!=")
        + "obs(invalid, false).\n?connected(1,20).\n",
        "plingo": f"location(1..20). block(1..{n}). {edges}\n"
        "&random(r(B)) { place(B,L) : location(L) } :- block(B).\n"
        ":- place(B1,L1), place(B2,L2), B1 < B2, L1 <= L2.\nblocked(L) :- place(_,L).\n"
        "connected(X,Y) :- edge(X,Y), not blocked(X), not blocked(Y).\n"
        "connected(X,Y) :- connected(Y,X), X != Y.\n"
        "connected(X,Z) :- connected(X,Y), connected(Y,Z), X != Z.\n&query(connected(1,20)).\n",
        "problog": "".join(
            "; ".join(f"1/20::place({b},{place})" for place in range(1, 21)) + ".\n" for b in range(1, n + 1)
        )
        + f"{edges}\ninvalid :- place(A,X), place(B,Y), A < B, X =< Y.\nevidence(\\+invalid).\n"
        + "blocked(L) :- place(_,L).\nnear(X,Y) :- edge(X,Y).\nnear(X,Y) :- edge(Y,X).\n"
        + "reach(X,X) :- \\+blocked(X).\nreach(X,Z) :- reach(X,Y), near(Y,Z), \\+blocked(Z).\n"
        + "query(reach(1,20)).\n",
    }
    ways = [set(blocked) for blocked in combinations(range(1, 21), n)]
    return Case(texts, sum(map(_open, ways)) / len(ways))


NEAR = {i: {a + b - i for a, b in LEFT + BELOW if i in (a, b)} for i in range(1, 5 * ROWS + 1)}


def _open(blocked: set[int]) -> bool:
    """Whether a path leads from 1 to 20."""
    reached = {1} - blocked
    todo = list(reached)
    while todo:
        new = NEAR[todo.pop()] - reached - blocked
        reached |= new
        todo += new
    return 20 in reached
