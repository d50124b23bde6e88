"""Measure one engine on one case in a separate process: `plog_engines.py ENGINE FAMILY ARGUMENTS`.

Each measurement is a line of JSON {kind, what, wall, cpu, rounds, wrong}: the medians in seconds over the
rounds, and the first wrong answer. Measurements of one kind are comparable: "text" is from the program's
text to the answer, "process" a whole command, "compiled" a question to a compiled program, "batch" one of
10,000 such questions.
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
from math import isnan
from pathlib import Path
from statistics import median
from typing import Any

import plog_families
import plog_relations
import plog_structures
from plog_families import Case
from plog_lcorpp import lcorpp

FAMILIES: Mapping[str, Callable[..., Case]] = {
    "lcorpp": lcorpp,
    **{f: getattr(plog_families, f) for f in ("chain", "dice", "dice_sum", "squirrel", "robot", "blocks")},
    **{f: getattr(plog_structures, f) for f in ("tree", "noisy_or", "corridor", "rooms", "assignment")},
    **{
        f: getattr(plog_relations, f)
        for f in ("smokers", "contagion", "supplies", "courses", "rumours", "outages")
    },
}
EXACT, ROUNDED, PRINTED = 1e-9, 2e-3, 1e-5
"""Relative tolerances for floating point and for plingo, which rounds the logarithms of its weights; absolute
tolerance for the digits that commands print."""

BATCH = 10_000
NUMBER = re.compile(r"(?:^|\):|robability:?)\s*(\d*\.?\d+(?:e[+-]?\d+)?)\s*$", re.M)
Row = dict[str, Any]


def read_cpu_seconds() -> float:
    """Return the CPU seconds of this process and of its ended children."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(u.ru_utime + u.ru_stime for u in used)


def measure(
    kind: str, what: str, calls: Sequence[Callable[[], Any]], seconds: float = 1.0
) -> tuple[Row, list[Any]]:
    """Call functions in turn until the seconds are over, each at least once.

    Short rounds are repeated within one measurement. The times are per call, medians over rounds.

    Returns:
        The measurement, and what the functions returned.
    """
    walls: list[float] = []
    cpus: list[float] = []
    results: list[Any] = []
    start, inner = time.perf_counter(), 1
    while not walls or (passed := time.perf_counter() - start) < seconds or len(walls) < 3 > passed / seconds:
        wall, cpu = time.perf_counter(), read_cpu_seconds()
        for _ in range(inner):
            results = [call() for call in calls]
        wall, cpu = time.perf_counter() - wall, read_cpu_seconds() - cpu
        walls.append(wall / inner / len(calls))
        cpus.append(cpu / inner / len(calls))
        if wall < 5e-3:
            inner, walls, cpus = inner * 4, [], []
    return make_row(kind, what, walls, cpus), results


def make_row(kind: str, what: str, walls: Sequence[float], cpus: Sequence[float], wrong: str = "") -> Row:
    """Return a measurement, ready to be printed."""
    times = {"wall": median(walls), "cpu": median(cpus)}
    return {"kind": kind, "what": what, **times, "rounds": len(walls), "wrong": wrong}


def check_answers(
    measured: tuple[Row, list[Any]],
    answers: Sequence[float],
    tolerance: float,
    number: Callable[[Any], float] = float,
    digits: float = 0.0,
) -> Row:
    """Return the measurement with its first wrong result; with the answer if there is no exact one."""
    if isnan(answers[0]):  # of relational programs, one case at a time
        return {**measured[0], "answer": number(measured[1][0])} if not digits else measured[0]
    pairs = zip(map(number, measured[1]), answers, strict=True)
    allowed = [tolerance * exact + digits for exact in answers]
    wrong = [
        f"{result:.6g}, not {exact:.6g}"
        for (result, exact), limit in zip(pairs, allowed, strict=True)
        if not abs(result - exact) <= limit
    ]
    return {**measured[0], "wrong": wrong[0] if wrong else ""}


def measure_command(arguments: Sequence[str | Path], cases: Sequence[Case], language: str) -> Row:
    """Measure a process for each case; the last number that it prints is its answer."""
    with tempfile.TemporaryDirectory() as folder:
        calls = []
        for i, case in enumerate(cases):
            file = Path(folder, f"{i}.{language}")
            file.write_text(case.texts[language], "utf-8")
            calls.append(partial(subprocess.run, [*arguments, file], capture_output=True, text=True))
        return check_answers(
            measure("process", f"{Path(arguments[0]).name} command", calls),
            [case.answer for case in cases],
            ROUNDED,
            lambda done: float((NUMBER.findall(done.stdout) or ["nan"])[-1]),
            PRINTED,
        )


def measure_lcorpp(cases: Sequence[Case]) -> Iterator[Row]:
    """Measure lcorpp: from text, compiled, as a command and, for the paper's question, in batches."""
    from lcorpp.reasoning import Reasoner, parse_plog

    def answer(text: str) -> Any:
        program = parse_plog(text, file="benchmark.plog")
        return Reasoner(program).ask(program.queries[0])

    texts = [case.texts["lcorpp"] for case in cases]
    yield check_answers(
        measure("text", "text to answer", [partial(answer, t) for t in texts]), list_answers(cases), EXACT
    )
    yield measure("parse", "of this, parsing", [partial(parse_plog, t, file="b.plog") for t in texts], 1)[0]
    yield measure_command([Path(sys.executable).with_name("lcorpp"), "ask"], cases, "lcorpp")
    case = cases[0]
    if not case.evidences:
        return
    name, value = case.query
    reasoner = Reasoner(parse_plog(case.texts["lcorpp"].split("?{")[0], file="benchmark.plog"))
    compile_case = partial(reasoner.compile, case.inputs, name)
    yield measure("compile", "compile", [compile_case])[0]
    evidences, exact = [dict(e) for e, _ in case.evidences], [answer for _, answer in case.evidences]
    circuit = compile_case()
    calls: list[Callable[[], Any]] = [partial(circuit, evidence) for evidence in evidences]
    turn = f"compiled, {len(calls)} evidences in turn"
    yield check_answers(
        measure("compiled", turn, calls), exact, EXACT, lambda marginal: float(marginal[value])
    )
    yield _measure_new_evidence(compile_case, evidences)
    calls = [partial(reasoner.posterior, name, evidence) for evidence in evidences]
    measured = measure("posterior", f"reasoner.posterior, {len(calls)} evidences in turn", calls)
    yield check_answers(measured, exact, EXACT, lambda marginal: float(marginal[value]))
    yield from _measure_batches(circuit, evidences, exact, circuit.values[name].index(value))


def _measure_new_evidence(compile_case: Callable[[], Any], evidences: Sequence[Mapping[str, str]]) -> Row:
    walls, cpus = [], []
    for _ in range(20):
        circuit = compile_case()
        for evidence in evidences:
            wall, cpu = time.perf_counter(), read_cpu_seconds()
            circuit(evidence)
            walls.append(time.perf_counter() - wall)
            cpus.append(read_cpu_seconds() - cpu)
    return make_row("compiled, new", "compiled, evidence new to the circuit", walls, cpus)


def _measure_batches(
    circuit: Any, evidences: Sequence[Mapping[str, str]], exact: Sequence[float], index: int
) -> Iterator[Row]:
    import numpy as np

    rows = np.random.default_rng(0).integers(len(evidences), size=BATCH)
    columns = {name: [evidences[i][name] for i in rows] for name in circuit.inputs}
    codes = circuit.encode(columns)
    expected = np.array(exact)[rows]
    for what, batch in (("codes", codes), ("columns of words", columns)):
        measurement, results = measure(
            "batch", f"one of a batch of {BATCH:,}, {what}", [partial(circuit, batch)]
        )
        wrong = (
            "" if np.allclose(results[0][:, index], expected, rtol=EXACT, atol=0) else "not the exact answers"
        )
        yield {
            **measurement,
            "wall": measurement["wall"] / BATCH,
            "cpu": measurement["cpu"] / BATCH,
            "wrong": wrong,
        }


def measure_plingo(cases: Sequence[Case]) -> Iterator[Row]:
    """Measure plingo: in this process, by the steps of `PlingoApp.main` but its output; and as a command."""
    from clingo.control import Control
    from plingo.plingo_app import PlingoApp
    from plingo.probability import ProbabilityModule
    from plingo.query import collect_query

    def answer(file: str) -> float:
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
        calls = [partial(answer, str(file)) for file in files]
        yield check_answers(
            measure("text", "text to answer, in-process", calls), list_answers(cases), ROUNDED
        )
    if len(cases) > 1:
        yield measure_command([Path(sys.executable).with_name("plingo"), "--frontend=plog"], cases, "plingo")


def measure_problog(compiler: str, cases: Sequence[Case]) -> Iterator[Row]:
    """Measure ProbLog with one of its compilers: from text, compiled once, and as a command."""
    from problog import get_evaluatable
    from problog.logic import Term
    from problog.program import PrologString

    sys.setrecursionlimit(10_000)  # as ProbLog's own command does

    def answer(text: str) -> float:
        found = get_evaluatable(compiler).create_from(PrologString(text)).evaluate()
        return float(next(iter(found.values())))

    calls = [partial(answer, case.texts["problog"]) for case in cases]
    yield check_answers(measure("text", "text to answer, in-process", calls), list_answers(cases), EXACT)
    if len(cases) > 1:
        yield measure_command([Path(sys.executable).with_name("problog"), "-k", compiler], cases, "problog")
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
    evidences = [{Term.from_string(atom): value for atom, value in each.items()} for each in observed]
    compile_case = partial(get_evaluatable(compiler).create_from, PrologString(text))
    yield measure("compile", "compile", [compile_case])[0]
    compiled = compile_case()
    measured = measure(
        "compiled",
        f"compiled, {len(evidences)} evidences in turn",
        [partial(compiled.evaluate, evidence=each) for each in evidences],
    )
    yield check_answers(measured, exact, EXACT, lambda result: float(next(iter(result.values()))))


def measure_plog2(cases: Sequence[Case]) -> Iterator[Row]:
    """Measure plog 2.0, which is a command only."""
    yield measure_command([shutil.which("plog2") or "plog2", "--mode=query", "--algo=dco"], cases, "plog2")


def list_answers(cases: Sequence[Case]) -> list[float]:
    """Return the exact answers."""
    return [case.answer for case in cases]


ENGINES: Mapping[str, Callable[[Sequence[Case]], Iterator[Row]]] = {
    "lcorpp": measure_lcorpp,
    "plingo": measure_plingo,
    "plog2": measure_plog2,
    "problog-sdd": partial(measure_problog, "sdd"),
    "problog-ddnnf": partial(measure_problog, "ddnnf"),
}


def main(engine: str, family: str, *sizes: str) -> None:
    """Measure one engine and print each measurement at once, so that a time limit loses no other."""
    cases = [FAMILIES[family](*map(int, sizes))] if sizes else [lcorpp(number) for number in range(12)]
    try:
        for measurement in ENGINES[engine](cases):
            print(json.dumps(measurement), flush=True)
    except Exception as error:  # the exception of a peer is its result
        lines = str(error).strip().splitlines() or [""]
        print(json.dumps({"failed": f"{type(error).__name__}: {lines[0]}"[:160]}), flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
