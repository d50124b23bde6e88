"""The paper's query in four languages: is this person interested, given time, location and classifier?"""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from itertools import product
from pathlib import Path

from plog_families import Case

LCORPP = Path(__file__).parents[1] / "tests" / "plog" / "lcorpp.plog"

IDENTITIES = {
    "student": (0.15, 0.15, 0.3, 0.3),
    "professor": (0.8, 0.1, 0.1, 0.1),
    "visitor": (0.1, 0.7, 0.8, 0.8),
}
"""P(morning), P(afternoon), P(library), P(interested) of each."""


def lcorpp(number: int) -> Case:
    """The paper's program with the query for the intention; `number` selects one of the 12 full evidences."""
    named = ("time", "location", "classifier")
    ranges = (("morning", "afternoon", "evening"), ("classroom", "library"), ("zero", "one"))
    evidences = tuple(dict(zip(named, values, strict=True)) for values in product(*ranges))
    pairs = tuple((evidence, _interested(evidence)) for evidence in evidences)
    evidence, answer = pairs[number % len(pairs)]
    observed = ", ".join(f"obs({name}={value})" for name, value in evidence.items())
    rows = LCORPP.read_text("utf-8").split("% expect")[0]
    return Case(
        {
            "lcorpp": f"{rows}?{{intention=interested}} | {observed}.\n",
            "plog2": _lcorpp_plog2(evidence),
            "plingo": _lcorpp_plingo(evidence),
            "problog": _lcorpp_problog(evidence),
        },
        answer,
        ("intention", "interested"),
        named,
        pairs,
    )


def _interested(evidence: Mapping[str, str]) -> float:
    sums = [0.0, 0.0]
    for morning, afternoon, library, interested in IDENTITIES.values():
        times = {"morning": morning, "afternoon": afternoon, "evening": 1 - morning - afternoon}
        weight = times[evidence["time"]] * (library if evidence["location"] == "library" else 1 - library)
        for i, (p, one) in enumerate(((interested, 0.76), (1 - interested, 0.29))):
            sums[i] += weight * p * (one if evidence["classifier"] == "one" else 1 - one)
    return sums[0] / sum(sums)


def _lcorpp_plog2(evidence: Mapping[str, str]) -> str:
    lines = [
        "sorts",
        "#identities = {student, professor, visitor}. #times = {morning, afternoon, evening}.",
        "#places = {classroom, library}. #intentions = {interested, not_interested}. #labels = {zero, one}.",
        "attributes",
        "identity : #identities. time : #times. location : #places.",
        "intention : #intentions. classifier : #labels.",
        "statements",
        *(f"random({name})." for name in ("identity", "time", "location", "intention", "classifier")),
    ]
    for who, (morning, afternoon, library, interested) in IDENTITIES.items():
        for head, p in (
            ("time = morning", morning),
            ("time = afternoon", afternoon),
            ("location = library", library),
            ("intention = interested", interested),
        ):
            lines.append(f"pr({head} | identity = {who}) = {Fraction(p).limit_denominator(100)}.")
    lines += ["pr(classifier = one | intention = interested) = 19/25."]
    lines += ["pr(classifier = one | intention = not_interested) = 29/100."]
    lines += [f"obs({name}, {value})." for name, value in evidence.items()]
    return "\n".join([*lines, "?intention = interested.\n"])


def _lcorpp_plingo(evidence: Mapping[str, str]) -> str:
    lines = [
        "identities(student;professor;visitor). times(morning;afternoon;evening). places(classroom;library).",
        "intentions(interested;not_interested). labels(zero;one).",
        "&random { identity(X) : identities(X) }.",
        "&random { time(X) : times(X) }.",
        "&random { location(X) : places(X) }.",
        "&random { intention(X) : intentions(X) }.",
        "&random { classifier(X) : labels(X) }.",
    ]
    for who, (morning, afternoon, library, interested) in IDENTITIES.items():
        lines += [
            f'&pr {{ time(morning) }} = "{morning}" :- identity({who}).',
            f'&pr {{ time(afternoon) }} = "{afternoon}" :- identity({who}).',
            f'&pr {{ location(library) }} = "{library}" :- identity({who}).',
            f'&pr {{ intention(interested) }} = "{interested}" :- identity({who}).',
        ]
    lines += ['&pr { classifier(one) } = "0.76" :- intention(interested).']
    lines += ['&pr { classifier(one) } = "0.29" :- intention(not_interested).']
    lines += [f"&obs {{ {name}({value}) }}." for name, value in evidence.items()]
    return "\n".join([*lines, "&query(intention(interested)).\n"])


def _lcorpp_problog(evidence: Mapping[str, str]) -> str:
    lines = ["1/3::identity(student); 1/3::identity(professor); 1/3::identity(visitor)."]
    for who, (morning, afternoon, library, interested) in IDENTITIES.items():
        evening = round(1 - morning - afternoon, 2)
        lines += [
            f"{morning}::time(morning); {afternoon}::time(afternoon); {evening}::time(evening)"
            f" :- identity({who}).",
            f"{library}::location(library); {1 - library:.1f}::location(classroom) :- identity({who}).",
            f"{interested}::intention(interested); {1 - interested:.1f}::intention(not_interested)"
            f" :- identity({who}).",
        ]
    lines += ["0.76::classifier(one); 0.24::classifier(zero) :- intention(interested)."]
    lines += ["0.29::classifier(one); 0.71::classifier(zero) :- intention(not_interested)."]
    lines += [f"evidence({name}({value}))." for name, value in evidence.items()]
    return "\n".join([*lines, "query(intention(interested)).\n"])
