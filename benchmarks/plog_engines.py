"""One engine on one case, measured in a process of its own: `plog_engines.py ENGINE FAMILY ARGUMENTS`.

Prints a list of measurements as JSON, each {kind, what, wall, cpu, wrong}: medians in seconds, the number of
repetitions, and what is wrong with the answers, if anything. Kinds are what can be compared: "text" is from
the program's text to the answer, "process" the whole command, "compiled" a question to a program that was
prepared before, "batch" each of 10,000 such questions.
"""

from __future__ import annotations

import json
import re
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from itertools import cycle
from pathlib import Path
from statistics import median
from typing import Any

import plog_families
from plog_families import Case
from plog_lcorpp import lcorpp

FAMILIES: Mapping[str, Callable[..., Case]] = {
    "lcorpp": lcorpp,
    **{f: getattr(plog_families, f) for f in ("chain", "dice", "dice_sum", "squirrel", "robot", "blocks")},
}
EXACT, ROUNDED = 1e-9, 2e-3
"""Relative tolerances: of floating point, and of plingo, which rounds the logarithms of its weights and
prints five digits."""

BATCH = 10_000
Row = dict[str, Any]


def spent() -> float:
    """CPU seconds of this process and of its children that have ended."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(u.ru_utime + u.ru_stime for u in used)


def timed(
    kind: str, what: str, calls: Sequence[Callable[[], Any]], seconds: float = 2.0, *, at_most: int = 10**6
) -> Row:
    """Call each of some functions in turn, all at least once, until the seconds are over.

    A round of short calls is repeated within one measurement until it lasts a millisecond or so, as clocks
    need; the median is over rounds.
    """
    walls, cpus, results = [], [], []
    end, inner = time.perf_counter() + seconds, 1
    while len(walls) < 3 or time.perf_counter() < end:
        if walls and (time.perf_counter() - end > 2 * seconds or len(walls) >= at_most):
            break
        wall, cpu = time.perf_counter(), spent()
        for _ in range(inner):
            results = [call() for call in calls]
        wall, cpu = time.perf_counter() - wall, spent() - cpu
        walls.append(wall / inner / len(calls))
        cpus.append(cpu / inner / len(calls))
        if wall < 2e-3:
            inner, walls, cpus = inner * 4, [], []
    found = {"kind": kind, "what": what, "wall": median(walls), "cpu": median(cpus), "rounds": len(walls)}
    return {**found, "results": results}


def checked(row: Row, answers: Sequence[float], tolerance: float) -> Row:
    """The row without its results, and with what is wrong with them."""
    pairs = list(zip(row.pop("results"), answers, strict=True))
    wrong = [f"{got:.6g}, not {exact:.6g}" for got, exact in pairs if not abs(got - exact) <= tolerance * exact]
    return {**row, "wrong": wrong[0] if wrong else ""}


def ours(cases: Sequence[Case]) -> list[Row]:
    """lcorpp: from text, compiled, as batches and as a command."""
    from lcorpp.reasoning import parse_plog
    from lcorpp.reasoning.engine import Engine

    def asked(case: Case) -> Any:
        program = parse_plog(case.texts["lcorpp"], file="benchmark.plog")
        return Engine(program).ask(program.queries[0])

    answers = [case.answer for case in cases]
    parse = timed("parse", "read the text", [lambda: parse_plog(cases[0].texts["lcorpp"], file="b.plog")], 0.5)
    del parse["results"]
    rows = [checked(timed("text", "text to answer", [lambda c=case: asked(c) for case in cases]), answers, EXACT)]
    rows.append({**parse, "wrong": ""})
    if cases[0].inputs:
        rows += _compiled(cases[0])
    if len(cases) > 1:
        rows += _batches(cases[0])
        rows.append(command([Path(sys.executable).with_name("lcorpp"), "ask"], "lcorpp", ".plog", cases, EXACT))
    return rows


def _compiled(case: Case) -> list[Row]:
    from lcorpp.reasoning import parse_plog

    name, value = case.query
    program = parse_plog(case.texts["lcorpp"], file="benchmark.plog")
    prepare = timed("compile", "compile", [lambda: program.compile(list(case.inputs), name)])
    del prepare["results"]
    evidences = [dict(evidence) for evidence, _ in case.evidences]
    answers = [answer for _, answer in case.evidences]
    circuit = program.compile(list(case.inputs), name)
    place = circuit.values[name].index(value)

    fresh, used = [], []
    for _ in range(20):  # circuits that never saw any evidence; the last evidence has seen the others
        circuit = program.compile(list(case.inputs), name)
        for evidence in evidences:
            wall, cpu = time.perf_counter(), spent()
            circuit(evidence)
            fresh.append(time.perf_counter() - wall)
            used.append(spent() - cpu)
    new = {"kind": "compiled", "what": "evidence never met", "wall": median(fresh), "cpu": sum(used) / len(used)}
    new |= {"rounds": len(fresh), "wrong": ""}

    def all_of() -> list[float]:
        return [circuit(evidence)[value] for evidence in evidences]

    found = timed("compiled", f"{len(evidences)} evidences in turn", [lambda e=e: circuit(e) for e in evidences])
    found["results"] = [result.p[place] for result in found["results"]]
    return [{**prepare, "wrong": ""}, new, checked(found, answers, EXACT)]
