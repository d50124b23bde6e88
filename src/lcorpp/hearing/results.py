"""Files of a measured observation model: the model, the recogniser's confidence, tables and a figure."""

from __future__ import annotations

import json
import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from lcorpp.csv_text import format_records
from lcorpp.files import has_matplotlib, make_folder, write_atomically
from lcorpp.hearing.answers import SILENCE, SOUND
from lcorpp.hearing.observing import Observed
from lcorpp.hearing.rates import HeardCases
from lcorpp.planning import format_pomdp
from lcorpp.worlds.speech.confidence import NONE, write_confidence

MODEL, CONFIDENCE, TABLE, SUMMARY, FIGURE = (
    "heard.pomdp",
    "heard.json",
    "rates.csv",
    "observe.json",
    "rates.png",
)
"""The files in the folder of a measurement."""


def write_observed(observed: Observed, folder: Path) -> list[Path]:
    """Write all files, the figure with matplotlib, and return their paths.

    Raises:
        FileError: the folder cannot be written.
    """
    make_folder(folder)
    write_atomically(folder / MODEL, format_model(observed))
    write_confidence(observed.confidence, folder / CONFIDENCE, origin=describe_origin(observed))
    rates = list_rates(observed)
    write_atomically(folder / TABLE, format_records(list(rates[0]), rates))
    write_atomically(folder / SUMMARY, json.dumps(summarise(observed), indent=1) + "\n")
    written = [MODEL, CONFIDENCE, TABLE, SUMMARY]
    if has_matplotlib():
        from lcorpp.hearing.figure import plot_rates
        from lcorpp.plot_style import save_figure

        save_figure(plot_rates(observed), folder / FIGURE)
        written.append(FIGURE)
    return [folder / name for name in written]


def describe_origin(observed: Observed) -> str:
    """Return a sentence on what was measured."""
    cases, kind = observed.tuning, "synthetic voices" if observed.is_synthetic else "recordings"
    mix = ", ".join(f"{name} ({share:.0%})" for name, share in zip(cases.noises, cases.shares, strict=True))
    return (
        f"measured by lcorpp observe on {kind} ({', '.join(observed.voices)}); noise: {mix};"
        f" {count_cases(cases)} for tuning, {count_cases(observed.test)} for the test"
    )


def count_cases(cases: HeardCases) -> str:
    """Return the numbers of cases, of sentences and of kinds of sounds."""
    is_sound = np.array([kind == SOUND for kind in cases.kinds])[cases.said]
    is_spoken = ~is_sound & np.array([kind != SILENCE for kind in cases.kinds])[cases.said]
    sounds = len(np.unique(cases.sentence[is_sound]))
    text = f"{len(cases.said)} cases of {len(np.unique(cases.sentence[is_spoken]))} sentences"
    return f"{text} and {sounds} kinds of sounds" if sounds else text


def find_answer_bins(observed: Observed, answer: str) -> tuple[str, ...]:
    """Return the observations of an answer: its bins; of `NONE` itself."""
    return tuple(name for name, _ in observed.confidence.bins.get(answer, ())) or (NONE,)


def list_rates(observed: Observed) -> list[dict[str, Any]]:
    """Return the rows of the table: P(heard | said, noise) in both parts, with Wilson intervals and n."""
    rows = []
    for part, cases in (("tuning", observed.tuning), ("test", observed.test)):
        for kind in cases.kinds:
            for noise in cases.noises:
                for name in cases.observations:
                    interval, n = cases.interval(kind, noise, (name,))
                    rows.append(
                        {
                            "part": part,
                            "said": kind,
                            "noise": noise,
                            "heard": name,
                            "rate": round(interval.estimate, 4),
                            "low": round(interval.low, 4),
                            "high": round(interval.high, 4),
                            "n": n,
                        }
                    )
    return rows


def list_recalls(observed: Observed) -> list[dict[str, Any]]:
    """Return the recall of what is said in the test, by noise: any bin of the answer; `NONE` of all else."""
    rows = []
    for kind in observed.test.kinds:
        for noise in observed.test.noises:
            interval, n = observed.test.interval(kind, noise, find_answer_bins(observed, kind))
            rows.append({"said": kind, "noise": noise, "recall": f"{interval:.3f}", "n": n})
    return rows


def find_wrong_share(observed: Observed) -> float:
    """Return how often an answer is heard as another one, among the answers that are heard: measured noise.

    In the mix of noises, of the test; comparable with the paper's 30 %.
    """
    cases = observed.test
    answers = list(observed.confidence.bins)
    rates = cases.estimate(cases.count())[: len(answers)]
    groups = np.array(
        [[name in find_answer_bins(observed, answer) for name in cases.observations] for answer in answers]
    )
    heard = rates @ groups.T  # (said, heard as)
    return float(1 - np.trace(heard) / heard.sum())


def summarise(observed: Observed) -> dict[str, Any]:
    """Return the results as JSON."""
    return {
        "origin": describe_origin(observed),
        "synthetic": observed.is_synthetic,
        "assumption": dict(observed.assumption),
        "bins": {answer: dict(rows) for answer, rows in observed.confidence.bins.items()},
        "stated value": observed.stated_value,
        "promised value": observed.value.interval.estimate,
        "simulated value": str(observed.simulated),
        "shortfall": observed.shortfall,
        "another answer heard": find_wrong_share(observed),
        "recall": list_recalls(observed),
        "cpu seconds": {
            "mean": float(observed.seconds.mean()),
            "95 %": float(np.quantile(observed.seconds, 0.95)),
        },
        "rates": list_rates(observed),
    }


def format_model(observed: Observed) -> str:
    """Return the model as a .pomdp file whose comments have the origin, the assumption and the intervals."""
    return "\n".join(_format_lines(observed)) + "\n"


def _format_lines(observed: Observed) -> Iterator[str]:
    model, said = observed.model, observed.said
    assumed = ", ".join(f"{name} {p:g}" for name, p in observed.assumption.items())
    text = (
        f"{observed.domain.name}: an observation model that is {describe_origin(observed)}."
        f" What people say is an assumption: {assumed}."
    )
    if observed.is_synthetic:
        text += " The speech is synthetic; people and a robot's own microphone will differ."
    yield from textwrap.wrap(text, 110, initial_indent="# ", subsequent_indent="# ", break_on_hyphens=False)
    yield "# P(heard | said), with Wilson's 95 % intervals over all cases of the tuning:"
    yield from _format_rates(observed.tuning)
    lines = format_pomdp(model).splitlines()
    first = next(place for place, line in enumerate(lines) if line.startswith("O:"))
    yield from lines[:first]
    yield f"# O(z | a, s') over {' '.join(model.observations)}"
    dense, (low, high) = model.observation.dense, observed.row_intervals
    for a, action in enumerate(model.actions):
        for s, state in enumerate(model.states):
            if said.is_measured[a, s]:
                ends = " ".join(f"{x:.3f}-{y:.3f}" for x, y in zip(low[a, s], high[a, s], strict=True))
                yield f"# 95 % intervals, by sentences: {ends}"
            yield f"O: {action} : {state}"
            yield " ".join(f"{p:.4f}" for p in dense[a, s])
    yield ""
    yield from (line for line in lines if line.startswith("R:"))


def _format_rates(cases: HeardCases) -> Iterator[str]:
    for kind in cases.kinds:
        parts, n = [], 0
        for name in cases.observations:
            interval, n = cases.interval(kind, None, (name,))
            parts.append(f"{name} {interval:.3f}")
        yield f"#   {kind} (n = {n}): {'; '.join(parts)}"
