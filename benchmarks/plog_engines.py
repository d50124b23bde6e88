"""One engine on one case, measured in a process of its own: `plog_engines.py ENGINE FAMILY ARGUMENTS`.

Prints measurements as lines of JSON, each {kind, what, wall, cpu, rounds, wrong}: medians in seconds over so
many rounds, and what is wrong with the answers, if anything. Kinds are what can be compared: "text" is from
the program's text to the answer, "process" a whole command, "compiled" a question to a program prepared
before, "batch" each of 10,000 such questions.
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
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
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
EXACT, ROUNDED, PRINTED = 1e-9, 2e-3, 1e-5
"""Relative tolerances of floating point and of plingo, which rounds the logarithms of its weights; and what
the digits that commands print leave open."""

BATCH = 10_000
NUMBER = re.compile(r"(?:^|\):|robability:?)\s*(\d*\.?\d+(?:e[+-]?\d+)?)\s*$", re.M)
Row = dict[str, Any]


def spent() -> float:
    """CPU seconds of this process and of its children that have ended."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(u.ru_utime + u.ru_stime for u in used)


def timed(
    kind: str, what: str, calls: Sequence[Callable[[], Any]], seconds: float = 1.0
) -> tuple[Row, list[Any]]:
    """Call some functions in turn until the seconds are over, each at least once.

    A round that is too short for a clock is repeated within one measurement. The times are per call, medians
    over rounds.

    Returns:
        The measurement, and what the functions returned.
    """
    walls: list[float] = []
    cpus: list[float] = []
    results: list[Any] = []
    start, inner = time.perf_counter(), 1
    while not walls or (passed := time.perf_counter() - start) < seconds or len(walls) < 3 > passed / seconds:
        wall, cpu = time.perf_counter(), spent()
        for _ in range(inner):
            results = [call() for call in calls]
        wall, cpu = time.perf_counter() - wall, spent() - cpu
        walls.append(wall / inner / len(calls))
        cpus.append(cpu / inner / len(calls))
        if wall < 5e-3:
            inner, walls, cpus = inner * 4, [], []
    return row(kind, what, walls, cpus), results


def row(kind: str, what: str, walls: Sequence[float], cpus: Sequence[float], wrong: str = "") -> Row:
    """A measurement, ready to be printed."""
    times = {"wall": median(walls), "cpu": median(cpus)}
    return {"kind": kind, "what": what, **times, "rounds": len(walls), "wrong": wrong}


def checked(
    found: tuple[Row, list[Any]],
    answers: Sequence[float],
    tolerance: float,
    number: Callable[[Any], float] = float,
    digits: float = 0.0,
) -> Row:
    """The measurement with what is wrong with its results, if anything."""
    pairs = zip(map(number, found[1]), answers, strict=True)
    allowed = [tolerance * exact + digits for exact in answers]
    wrong = [
        f"{got:.6g}, not {exact:.6g}"
        for (got, exact), most in zip(pairs, allowed, strict=True)
        if not abs(got - exact) <= most
    ]
    return {**found[0], "wrong": wrong[0] if wrong else ""}


def command(arguments: Sequence[str | Path], cases: Sequence[Case], language: str) -> Row:
    """A whole process for each case; the last number that it prints is its answer."""
    with tempfile.TemporaryDirectory() as folder:
        calls = []
        for i, case in enumerate(cases):
            file = Path(folder, f"{i}.{language}")
            file.write_text(case.texts[language], "utf-8")
            calls.append(partial(subprocess.run, [*arguments, file], capture_output=True, text=True))
        return checked(
            timed("process", f"{Path(arguments[0]).name} command", calls),
            [case.answer for case in cases],
            ROUNDED,
            lambda done: float((NUMBER.findall(done.stdout) or ["nan"])[-1]),
            PRINTED,
        )


def lcorpp_rows(cases: Sequence[Case]) -> Iterator[Row]:
    """lcorpp: from text, compiled, as a command and, for the paper's question, in batches."""
    from lcorpp.reasoning import Reasoner, parse_plog

    def asked(text: str) -> Any:
        program = parse_plog(text, file="benchmark.plog")
        return Reasoner(program).ask(program.queries[0])

    texts = [case.texts["lcorpp"] for case in cases]
    yield checked(timed("text", "text to answer", [partial(asked, t) for t in texts]), answers(cases), EXACT)
    yield timed(
        "parse", "of this, to read the text", [partial(parse_plog, t, file="b.plog") for t in texts], 1
    )[0]
    yield command([Path(sys.executable).with_name("lcorpp"), "ask"], cases, "lcorpp")
    case = cases[0]
    if not case.evidences:
        return
    name, value = case.query
    reasoner = Reasoner(parse_plog(case.texts["lcorpp"].split("?{")[0], file="benchmark.plog"))
    compiling = partial(reasoner.compile, case.inputs, name)
    yield timed("compile", "compile", [compiling])[0]
    evidences, exact = [dict(e) for e, _ in case.evidences], [answer for _, answer in case.evidences]
    circuit = compiling()
    calls: list[Callable[[], Any]] = [partial(circuit, evidence) for evidence in evidences]
    turn = f"compiled, {len(calls)} evidences in turn"
    yield checked(timed("compiled", turn, calls), exact, EXACT, lambda marginal: float(marginal[value]))
    yield _never_met(compiling, evidences)
    calls = [partial(reasoner.posterior, name, evidence) for evidence in evidences]
    found = timed("posterior", f"reasoner.posterior, {len(calls)} evidences in turn", calls)
    yield checked(found, exact, EXACT, lambda marginal: float(marginal[value]))
    yield from _batches(circuit, evidences, exact, circuit.values[name].index(value))


def _never_met(compiling: Callable[[], Any], evidences: Sequence[Mapping[str, str]]) -> Row:
    walls, cpus = [], []
    for _ in range(20):
        circuit = compiling()
        for evidence in evidences:
            wall, cpu = time.perf_counter(), spent()
            circuit(evidence)
            walls.append(time.perf_counter() - wall)
            cpus.append(spent() - cpu)
    return row("compiled, new", "compiled, evidence that this circuit never met", walls, cpus)


def _batches(
    circuit: Any, evidences: Sequence[Mapping[str, str]], exact: Sequence[float], place: int
) -> Iterator[Row]:
    import numpy as np

    drawn = np.random.default_rng(0).integers(len(evidences), size=BATCH)
    columns = {name: [evidences[i][name] for i in drawn] for name in circuit.inputs}
    codes = circuit.encode(columns)
    wanted = np.array(exact)[drawn]
    for what, batch in (("codes", codes), ("columns of words", columns)):
        found, results = timed("batch", f"one of a batch of {BATCH:,}, {what}", [partial(circuit, batch)])
        wrong = (
            "" if np.allclose(results[0][:, place], wanted, rtol=EXACT, atol=0) else "not the exact answers"
        )
        yield {**found, "wall": found["wall"] / BATCH, "cpu": found["cpu"] / BATCH, "wrong": wrong}


def plingo_rows(cases: Sequence[Case]) -> Iterator[Row]:
    """plingo: in this process, by the steps of its `PlingoApp.main` but the printing; and as a command."""
    from clingo.control import Control
    from plingo.plingo_app import PlingoApp
    from plingo.probability import ProbabilityModule
    from plingo.query import collect_query

    def asked(file: str) -> float:
        app = PlingoApp()
        app.frontend = "plog"
        control = Control(["--warn=none"])
        observer = app._preprocessing(control, [file])
        control.ground([("base", [])])
        app.query = collect_query(control.theory_atoms, None)
        costs = app._solve(control, observer)
        worlds = ProbabilityModule(
            costs, observer.priorities, ["plog", app.two_solve_calls, app.power_of_ten]
        )
        return float(sum(worlds.model_probs[i] for i in app.query[0][1]))

    with tempfile.TemporaryDirectory() as folder:
        files = [Path(folder, f"{i}.lp") for i in range(len(cases))]
        for file, case in zip(files, cases, strict=True):
            file.write_text(case.texts["plingo"], "utf-8")
        calls = [partial(asked, str(file)) for file in files]
        yield checked(timed("text", "text to answer, in-process", calls), answers(cases), ROUNDED)
    if len(cases) > 1:
        yield command([Path(sys.executable).with_name("plingo"), "--frontend=plog"], cases, "plingo")


def problog_rows(compiler: str, cases: Sequence[Case]) -> Iterator[Row]:
    """ProbLog with one of its compilers: from text, compiled once, and as a command."""
    from problog import get_evaluatable
    from problog.logic import Term
    from problog.program import PrologString

    sys.setrecursionlimit(10_000)  # as ProbLog's own command does

    def asked(text: str) -> float:
        found = get_evaluatable(compiler).create_from(PrologString(text)).evaluate()
        return float(next(iter(found.values())))

    calls = [partial(asked, case.texts["problog"]) for case in cases]
    yield checked(timed("text", "text to answer, in-process", calls), answers(cases), EXACT)
    if len(cases) > 1:
        yield command([Path(sys.executable).with_name("problog"), "-k", compiler], cases, "problog")
    case = cases[0]
    if not case.evidences:
        return
    observed = [
        {n if v in ("true", "false") else f"{n}({v})": v != "false" for n, v in evidence.items()}
        for evidence, _ in case.evidences
    ]
    rules = [line for line in case.texts["problog"].splitlines() if not line.startswith("evidence(")]
    text = "\n".join([*rules, *sorted({f"evidence({atom})." for each in observed for atom in each})])
    exact = [answer for _, answer in case.evidences]
    given = [{Term.from_string(atom): seen for atom, seen in each.items()} for each in observed]
    compiling = partial(get_evaluatable(compiler).create_from, PrologString(text))
    yield timed("compile", "compile", [compiling])[0]
    compiled = compiling()
    found = timed(
        "compiled",
        f"compiled, {len(given)} evidences in turn",
        [partial(compiled.evaluate, evidence=each) for each in given],
    )
    yield checked(found, exact, EXACT, lambda result: float(next(iter(result.values()))))


def plog2_rows(cases: Sequence[Case]) -> Iterator[Row]:
    """plog 2.0, which is a command only."""
    yield command([shutil.which("plog2") or "plog2", "--mode=query", "--algo=dco"], cases, "plog2")


def answers(cases: Sequence[Case]) -> list[float]:
    """The exact answers."""
    return [case.answer for case in cases]


ENGINES: Mapping[str, Callable[[Sequence[Case]], Iterator[Row]]] = {
    "lcorpp": lcorpp_rows,
    "plingo": plingo_rows,
    "plog2": plog2_rows,
    "problog-sdd": partial(problog_rows, "sdd"),
    "problog-ddnnf": partial(problog_rows, "ddnnf"),
}


def main(engine: str, family: str, *sizes: str) -> None:
    """Measure one engine; each measurement is printed as it is made, so that a time limit loses no other."""
    cases = [FAMILIES[family](*map(int, sizes))] if sizes else [lcorpp(number) for number in range(12)]
    try:
        for found in ENGINES[engine](cases):
            print(json.dumps(found), flush=True)
    except Exception as error:  # whatever a peer raises is its result
        lines = str(error).strip().splitlines() or [""]
        print(json.dumps({"failed": f"{type(error).__name__}: {lines[0]}"[:160]}), flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
