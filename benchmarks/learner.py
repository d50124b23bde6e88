"""Training time of the paper's classifier, compared with Keras and with its matrix products alone.

    python benchmarks/learner.py [--keras-python PATH] [--epochs 300] [--keras-epochs 300] [--out TABLE.md]

Five-fold cross-validation and the final training on 2000 tracks of 30 points: 50 units, dropout .2, batches
of 32, Adam. lcorpp trains as in `lcorpp run`; Keras trains on the same folds in two processes of one core
each, on JAX and on torch, if the interpreter of `--keras-python` has them. The floor is the time of the
matrix products alone, by torch.mm on one core.
"""

from __future__ import annotations

import json
import os
import platform
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.console import Console

from lcorpp.files import make_folder, write_atomically
from lcorpp.learning import fast_pipeline, paper_pipeline
from lcorpp.learning.lstm.network import Weights
from lcorpp.learning.lstm.trainer import TrainingConfig, TrainingSet
from lcorpp.learning.lstm.training import select_trainer
from lcorpp.values import Dataset

CASES, FOLDS, BATCH, UNITS, DROPOUT = 2000, 5, 32, 50, 0.2
FAST = fast_pipeline().named_steps["lstm"]
KERAS = Path(__file__).with_name("learner_keras.py")
BACKENDS = ("jax", "torch")

OURS = """
import json, resource, sys, time
import numpy as np
from joblib.externals.loky import get_reusable_executor
from lcorpp.learning import fast_pipeline, paper_pipeline, train_and_validate
from lcorpp.values import Dataset
given = np.load(sys.argv[1])
dataset = Dataset(given["tracks"], tuple(given["labels"].tolist()))
made = {"paper": paper_pipeline, "fast": fast_pipeline}[sys.argv[2]](**json.loads(sys.argv[3]))
began = time.perf_counter()
validation = train_and_validate(made, dataset, folds=5, jobs=2)[1]
wall = time.perf_counter() - began
get_reusable_executor().shutdown(wait=True)
usage = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
cpu = sum(u.ru_utime + u.ru_stime for u in usage)
print(json.dumps({"wall": wall, "cpu": cpu, "folds": list(validation.folds)}))
"""


@dataclass(frozen=True)
class Row:
    """A line of the table, in seconds.

    epoch: CPU time of one over 1600 tracks. cpu, wall: of all six trainings.
    """

    name: str
    epoch: float
    cpu: float
    wall: float | None = None
    note: str = ""


def main(
    keras_python: Annotated[Path, typer.Option(help="An interpreter that has Keras.")] = Path(sys.executable),
    epochs: Annotated[int, typer.Option(min=1, help="Of every training.")] = 300,
    keras_epochs: Annotated[
        int | None,
        typer.Option(min=3, help="Of Keras's, scaled up in the table; as many as ours by default."),
    ] = None,
    out: Annotated[Path, typer.Option(help="The table; the plot goes beside it.")] = Path(
        "benchmarks/results/learner.md"
    ),
) -> None:
    """Measure, then write a table and a plot."""
    console = Console(stderr=True)
    dataset = _walks()
    with tempfile.TemporaryDirectory() as folder:
        console.print("the floor, and one epoch ...")
        floor, own, by_torch = _floor(), _epoch(compiled=True), _epoch(compiled=False)
        file = Path(folder) / "cases.npz"
        np.savez(file, tracks=dataset.trajectories, labels=np.array(dataset.labels))
        console.print("lcorpp, the paper's setting ...")
        paper = _ours(file, "paper", epochs=epochs)
        floor = min(floor, _floor())
        console.print("lcorpp, the fast setting ...")
        fast = _ours(file, "fast")
        start = _ours(file, "fast", epochs=1)
        passes = epochs * (CASES + FOLDS * (CASES * (FOLDS - 1) // FOLDS)) / (CASES * (FOLDS - 1) / FOLDS)
        rows = [
            Row("matrix products alone (the floor)", floor, passes * floor),
            Row("lcorpp", own, paper["cpu"], paper["wall"]),
            Row(
                "lcorpp, `fast_pipeline`",
                own,
                fast["cpu"],
                fast["wall"],
                f"{FAST.epochs} epochs, at least {FAST.min_updates} updates",
            ),
            Row("lcorpp, one epoch", own, start["cpu"], start["wall"], "what it takes to start"),
            Row("lcorpp by torch, without its kernels", by_torch, passes * by_torch, note="epochs alone"),
        ]
        np.savez(
            file,
            x=_network_inputs(dataset),
            y=np.array([label == "b" for label in dataset.labels], dtype=np.float32),
            folds=np.array(paper["folds"]),
        )
        for backend in BACKENDS:
            console.print(f"Keras on {backend} ...")
            row = _keras(keras_python, backend, file, epochs, min(keras_epochs or epochs, epochs))
            if isinstance(row, str):
                console.print(f"Keras on {backend} is left out: {row}")
            else:
                rows.append(row)
    make_folder(out.parent)
    write_atomically(out, _table(rows, epochs, keras_epochs))
    _plot(rows, out.with_suffix(".png"))
    console.print(f"wrote {out} and {out.with_suffix('.png')}")


def _walks() -> Dataset:
    """Random walks of ten seconds with two speeds; the training time does not depend on the tracks."""
    rng = np.random.default_rng(0)
    slow = np.arange(CASES) % 2 == 0
    tracks = rng.normal(0, np.where(slow, 0.03, 0.04)[:, None, None], (CASES, 2, 304)).cumsum(axis=2)
    return Dataset(tracks, tuple(np.where(slow, "a", "b").tolist()))


def _network_inputs(dataset: Dataset) -> np.ndarray:
    """(cases, time points, channels) the inputs of the LSTM in the pipeline."""
    steps = paper_pipeline()[:-1].fit(dataset.trajectories)
    return np.ascontiguousarray(steps.transform(dataset.trajectories).transpose(0, 2, 1), dtype=np.float32)


def _floor() -> float:
    """CPU seconds of the matrix products of an epoch over 1600 tracks of 30 points, minimum of several.

    Products with the inputs and those that give the gradients of the weights are made for all time points
    of a batch at once, the others one time point after the other, as they must.
    """
    import torch

    torch.set_num_threads(1)
    points, gates = 30, 4 * UNITS
    x, h, d = (torch.randn(points * BATCH, n) for n in (2, UNITS, gates))
    w_x, w_h = torch.randn(2, gates), torch.randn(UNITS, gates)
    h_t, x_t, w_t = h.t(), x.t(), w_h.t().contiguous()  # as a view it would take three times as long
    hs, ds = h.split(BATCH), d.split(BATCH)
    out = [torch.empty(n, gates) for n in (points * BATCH, BATCH, UNITS, 2)]
    back = torch.empty(BATCH, UNITS)

    def batch() -> None:
        torch.mm(x, w_x, out=out[0])
        for t in range(points):
            torch.mm(hs[t], w_h, out=out[1])
        for t in range(points):
            torch.mm(ds[t], w_t, out=back)
        torch.mm(h_t, d, out=out[2])
        torch.mm(x_t, d, out=out[3])

    def epoch() -> None:
        for _ in range(1600 // BATCH):
            batch()

    return min(_timed(epoch) for _ in range(8))


def _epoch(*, compiled: bool) -> float:
    """CPU seconds of an epoch over 1600 tracks of 30 points, minimum of several."""
    from lcorpp.learning.lstm.torch_trainer import TorchTrainer

    rng = np.random.default_rng(0)
    n = CASES * (FOLDS - 1) // FOLDS
    inputs = rng.normal(size=(n, 30, 2)).astype(np.float32)
    lengths = np.full(n, inputs.shape[1])
    cases = TrainingSet(inputs, lengths, (np.arange(n) % 2).astype(np.int32), np.ones(n, dtype=np.float32), 2)
    plan = TrainingConfig(
        units=UNITS, dropout=DROPOUT, epochs=1, batch_size=BATCH, learning_rate=1e-3, schedule="constant"
    )
    start = Weights.initialize(2, UNITS, 1, rng)
    trainer = (
        select_trainer("cpu")(start, cases, plan) if compiled else TorchTrainer(start, cases, plan, "cpu")
    )

    def epoch() -> None:
        mask = rng.random((n, UNITS), dtype=np.float32) < 1 - DROPOUT
        trainer.run_epoch(rng.permutation(n), mask, np.full(n // BATCH, 1e-3))

    return min(_timed(epoch) for _ in range(6))


def _timed(work: Any) -> float:
    began = time.process_time()
    work()
    return time.process_time() - began


def _ours(file: Path, setting: str, **options: int) -> dict[str, Any]:
    """Run OURS with options of the pipeline in its own process and return what it prints."""
    command = [sys.executable, "-c", OURS, str(file), setting, json.dumps(options)]
    done = subprocess.run(command, capture_output=True, text=True, check=True, env=_environment())
    report: dict[str, Any] = json.loads(done.stdout)
    return report


def _keras(python: Path, backend: str, file: Path, epochs: int, measured: int) -> Row | str:
    """Train Keras on the same folds in two processes; return the reason if that fails.

    If fewer epochs are measured, the mean of all but the first of each training is used for the others.
    """
    environment = _environment() | {"KERAS_BACKEND": backend}
    shares = [(0, [-1, 0, 1]), (1, [2, 3, 4])]  # as even as can be
    running = [
        subprocess.Popen(
            [str(python), str(KERAS), str(file), str(measured), str(core), *map(str, folds)],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env=environment,
        )
        for core, folds in shares
    ]
    outputs = [process.communicate() for process in running]
    for process, (_, errors) in zip(running, outputs, strict=True):
        if process.returncode:
            return (errors.strip().splitlines() or ["it failed without a message"])[-1]
    reports = [json.loads(text.splitlines()[-1]) for text, _ in outputs]
    walls, cpu, single = [], 0.0, []
    for report in reports:
        later = [np.mean(times[1:], axis=0) for times in report["seconds"]]
        missing = (epochs - measured) * np.sum(later, axis=0)
        walls.append(report["wall"] + missing[0])
        cpu += report["cpu"] + missing[1]
        single += [mean[1] * 1600 / size for mean, size in zip(later, report["sizes"], strict=True)]
    note = f"Keras {reports[0]['keras']}"
    if measured < epochs:
        note += f", measured on {measured} epochs and scaled to {epochs}"
    return Row(f"Keras on {backend}", min(single), cpu, max(walls), note)


def _environment() -> dict[str, str]:
    """One thread per process: on matrices this small more threads wait for each other."""
    single = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
    return {**os.environ, **single, "XLA_FLAGS": "--xla_cpu_multi_thread_eigen=false"}


def _table(rows: list[Row], epochs: int, keras_epochs: int | None) -> str:
    floor, own = rows[0], rows[1]
    options = f"--epochs {epochs}" + (f" --keras-epochs {keras_epochs}" if keras_epochs else "")
    lines = [
        "# Training the paper's classifier",
        "",
        f"`python benchmarks/learner.py {options}`, {date.today()}, {_processor()}, {os.cpu_count()} cores,"
        f" Python {platform.python_version()}. Five folds of 1600 tracks and the final training on {CASES},"
        f" 30 points of 2 channels, {epochs} epochs, {UNITS} units, batches of {BATCH}, Adam; two processes"
        " of one thread each. CPU and wall time of lcorpp and of Keras include starting the processes and"
        " compiling networks; an epoch is the CPU time of one over 1600 tracks, the least of several (of"
        " Keras the least mean of a training). The floor is the time of the matrix products alone, by"
        " torch.mm on one core; the shares are lcorpp's CPU and wall time over those of the row.",
        "",
        "| | epoch (ms) | CPU (s) | over the floor | wall (s) | share: CPU | share: wall | |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        cells = [
            row.name,
            f"{1e3 * row.epoch:.1f}",
            f"{row.cpu:.1f}",
            f"{row.cpu / floor.cpu:.2f}",
            "-" if row.wall is None else f"{row.wall:.1f}",
            "-" if row is own else f"{own.cpu / row.cpu:.2f}",
            "-" if row is own or own.wall is None or row.wall is None else f"{own.wall / row.wall:.2f}",
            row.note,
        ]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def _processor() -> str:
    try:
        text = Path("/proc/cpuinfo").read_text()
        return next(line.split(":")[1].strip() for line in text.splitlines() if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor() or platform.machine()


def _plot(rows: list[Row], path: Path) -> None:
    import io

    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axis = plt.subplots(figsize=(7, 0.45 * len(rows) + 1), layout="constrained")
    shown = rows[::-1]
    colours = ["#1b6ca8" if "lcorpp" in row.name else "#888888" for row in shown]
    bars = axis.barh([row.name.replace("`", "") for row in shown], [row.cpu for row in shown], color=colours)
    axis.bar_label(bars, [f" {row.cpu:.0f} s" if row.cpu >= 10 else f" {row.cpu:.1f} s" for row in shown])
    axis.set(xscale="log", xlabel="CPU time of five folds and the final training (s)")
    axis.set_xlim(right=3 * max(row.cpu for row in rows))  # space for the last label
    picture = io.BytesIO()
    figure.savefig(picture, dpi=110, format="png")
    write_atomically(path, picture.getvalue())


if __name__ == "__main__":
    typer.run(main)
