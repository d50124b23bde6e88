"""A figure beyond the paper: LCORPP+trust with right and with wrong knowledge, and what it learns.

The setting is the preset `paper`: 30 % of the answers are wrong, which the planner's model does not state.
The swapped knowledge is the paper's misleading one (`knowledge_low.plog`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import cycle

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from lcorpp.assembly.progress import ProgressDisplay
from lcorpp.assembly.senses import from_channel
from lcorpp.assembly.strategies.trust import TRUST
from lcorpp.assembly.strategies.trust_setup import set_up_trust
from lcorpp.decision import Robot, dt_control
from lcorpp.domains import Domain
from lcorpp.experiments.figures import knowledge
from lcorpp.experiments.figures.evaluation import Evaluation, evaluate, make_planner
from lcorpp.experiments.figures.panels import LABELS, Bars, add_bar_legend, draw_bars, draw_line, make_panels
from lcorpp.experiments.figures.result import (
    FigureOptions,
    FigureResult,
    Finding,
    Layout,
    Row,
    judge,
    subtract_from,
)
from lcorpp.experiments.figures.seeds import compute_seed_interval, run_seeds, subtract
from lcorpp.fitting.pr_atoms import find_number, map_pr_atoms
from lcorpp.planning import Planner
from lcorpp.plot_style import BLUE, COLOURS, MUTED, ORANGE, with_style
from lcorpp.reasoning import Program, Reasoner
from lcorpp.reasoning.language.syntax import Number, Probability
from lcorpp.scoring.metrics import make_cells
from lcorpp.simulation.people_stream import PeopleStream
from lcorpp.values import Array, Interval

SETTING = "paper"
"""The preset that determines everything but the robot's knowledge."""

KNOWLEDGE: Mapping[str, str] = {"right": COLOURS[2], "swapped": COLOURS[3], "inverted": COLOURS[5]}
"""Knowledge about the intention, with its colour: the truth, professor and visitor exchanged, each number p
replaced by 1 - p."""

BASELINES: Mapping[str, str] = {"P": MUTED, "R+P": COLOURS[5], "L+P": COLOURS[0], "LCORPP": ORANGE}
"""The strategies beside trust, with their colours; the first one uses no evidence."""

TRUST_COLOUR = COLOURS[2]

SEEDS, FAST_SEEDS = 6, 3
BLOCKS, FAST_BLOCKS = 10, 2
BLOCK = 100
"""Streams of people; blocks of people in each, and people in a block."""

WEIGHTS_SHOWN = ("right", "swapped")
"""Knowledge of which the figure shows the weights of the sources."""

SOURCES: Mapping[str, str] = {
    "knowledge": BLUE,
    "knowledge without labels": "#5f8fc7",
    "corrected": "#9dbde0",
    "learnt": ORANGE,
    "recent": "#f2cfa5",
    "classifier": MUTED,
    "no evidence": "#c9d0d8",
}
"""Sources of trust from the bottom of the figure, with their colours: blue with knowledge, orange without."""


@dataclass(frozen=True, eq=False)
class Stream:
    """Returns and weights of trust in a stream of people.

    returns: (blocks,) mean return of the people of each block. sources: their names.
    weights: (blocks, sources) at the end of each block. first_weights: (sources,) before the first person.
    """

    returns: Array
    sources: tuple[str, ...]
    weights: Array
    first_weights: Array


Streams = Mapping[str, Sequence[Stream]]
"""Knowledge -> a stream for each seed, of the same people with any knowledge."""

Evaluations = Mapping[str, Evaluation]
"""Knowledge -> scores of the baselines."""


def make_figure(options: FigureOptions, progress: ProgressDisplay) -> FigureResult:
    """Score the baselines with each knowledge, and let trust learn from streams of people."""
    domains = {name: make_domain(name) for name in KNOWLEDGE}
    evaluations = {
        name: evaluate(domain, name, options, progress, names=tuple(BASELINES))
        for name, domain in domains.items()
    }
    planner = make_planner(domains["right"], progress)
    n, blocks = (FAST_SEEDS, FAST_BLOCKS) if options.fast else (SEEDS, BLOCKS)
    unit = partial(run_streams, domains, planner, blocks)
    with progress(f"{TRUST.name}, {blocks * BLOCK} people", n) as advance:
        measured = run_seeds(unit, range(options.seed, options.seed + n), options.jobs, advance)
    return make_result(evaluations, {name: [one[name] for one in measured] for name in KNOWLEDGE})


def make_domain(name: str) -> Domain:
    """Return the domain `intention` with the robot's knowledge of a name in `KNOWLEDGE`."""
    domain = knowledge.make_domain(SETTING, "Low" if name == "swapped" else "High")
    if name == "inverted":
        program = invert(domain.program, "intention")
        domain = replace(domain, reasoning=replace(domain.reasoning, program=program))
    return domain


def invert(program: Program, attribute: str) -> Program:
    """Return a program in which each number p of the pr-atoms of a Boolean attribute is 1 - p."""

    def change(atom: Probability) -> Probability:
        number = find_number(atom)
        assert number is not None
        return replace(atom, number=Number(1 - number))

    return map_pr_atoms(program, attribute, change)


def run_streams(domains: Mapping[str, Domain], planner: Planner, blocks: int, seed: int) -> dict[str, Stream]:
    """Return knowledge -> the stream of trust with it, of the people of a seed."""
    return {name: run_stream(domain, planner, blocks, seed) for name, domain in domains.items()}


def run_stream(domain: Domain, planner: Planner, blocks: int, seed: int) -> Stream:
    """Let a robot with trust decide about the people of a seed, one after another."""
    senses = {sense.name: from_channel(domain, sense) for sense in domain.senses}
    classifiers = {name: setup.classifier for name, setup in senses.items()}
    people = PeopleStream(domain, {name: setup.signals for name, setup in senses.items()}, seed)
    trust = set_up_trust(domain, Reasoner(domain.program), planner)
    returns, weights, first = list[float](), list[Array](), trust.weights
    for _ in range(blocks):
        for _ in range(BLOCK):
            instance, world = people.next()
            episode = dt_control(Robot(classifiers, trust, trust.make_planner(), domain), instance, world)
            returns.append(people.result(episode).return_)
            trust.learn(episode.evidence, episode.steps)
        weights.append(trust.weights)
    means = np.array(returns).reshape(blocks, BLOCK).mean(axis=1)
    return Stream(means, trust.sources, np.array(weights), first)


def make_result(evaluations: Evaluations, streams: Streams) -> FigureResult:
    """Return the result of the evaluations and streams."""
    one_knowledge = streams["right"]
    n_people = BLOCK * len(one_knowledge[0].returns)
    return FigureResult(
        name="trust",
        title="Trust with right and with wrong knowledge",
        table=[row for name in streams for row in _make_rows(name, evaluations[name], streams[name])],
        findings=list(_judge(evaluations, streams)),
        draw=partial(_draw, evaluations, streams),
        notes=[
            "Not in the paper. 30 % of the answers are wrong, 20 or 10 % by the planner's model.",
            "With swapped knowledge, the paper's misleading one, professors are likely to want to interact"
            " and visitors are not; with inverted knowledge each probability p of the intention is 1 - p.",
            f"{TRUST.name} learns without labels. Its return is the mean over all {n_people} people of"
            f" each of {len(one_knowledge)} streams, the first ones included; intervals are Student's over"
            " the streams.",
        ],
        configuration={
            "domain": "intention",
            "preset": SETTING,
            "classifier": "noisy channel",
            "trials": evaluations["right"].trials,
            "streams": len(one_knowledge),
            "people": n_people,
        },
    )


def _make_rows(name: str, evaluation: Evaluation, streams: Sequence[Stream]) -> Iterator[Row]:
    """Yield the baselines, trust over all people, and each block with the weights at its end."""
    sources, weights = streams[0].sources, np.mean([stream.weights for stream in streams], axis=0)
    none = {f"weight_{source}": None for source in sources}
    returns = {("exact", strategy): scores.return_ for strategy, scores in evaluation.exact.items()} | {
        ("simulated", strategy): scores.return_ for strategy, scores in evaluation.simulated.items()
    }
    returns["simulated", TRUST.name] = compute_mean_return(streams)
    for (kind, strategy), interval in returns.items():
        head = {"knowledge": name, "strategy": strategy, "scores": kind, "first": None, "last": None}
        yield {**head, **make_cells({"return": interval}), **none}
    for block, own in enumerate(weights.tolist()):
        yield {
            "knowledge": name,
            "strategy": TRUST.name,
            "scores": "simulated",
            "first": 1 + block * BLOCK,
            "last": (block + 1) * BLOCK,
            **make_cells({"return": compute_seed_interval([s.returns[block] for s in streams])}),
            **{f"weight_{source}": weight for source, weight in zip(sources, own, strict=True)},
        }


def compute_mean_return(streams: Sequence[Stream]) -> Interval:
    """Return the mean return over all people, with its interval over the streams."""
    return compute_seed_interval([float(stream.returns.mean()) for stream in streams])


def _judge(evaluations: Evaluations, streams: Streams) -> Iterator[Finding]:
    """Decide whether trust is above the best baseline, and whether wrong knowledge loses weight."""
    for name, own in streams.items():
        exact = {s: scores.return_.estimate for s, scores in evaluations[name].exact.items()}
        best = max(exact, key=lambda strategy: exact[strategy])
        mean = compute_mean_return(own)
        gain = subtract_from(0, subtract_from(exact[best], mean))
        yield Finding(
            f"{TRUST.name} returns more than the best of {', '.join(BASELINES)}, {name} knowledge",
            judge([gain]),
            f"{mean:.1f}; minus {best} {gain:.2f}",
        )
    last = {
        name: [float(stream.weights[-1, stream.sources.index("knowledge")]) for stream in own]
        for name, own in streams.items()
    }
    for name in list(streams)[1:]:
        yield Finding(
            f"In the end the knowledge has less weight if it is {name} than if it is right",
            judge([subtract(last["right"], last[name])]),
            f"{np.mean(last[name]):.2f}, right {np.mean(last['right']):.2f}",
        )


@with_style
def _draw(evaluations: Evaluations, streams: Streams, layout: Layout) -> Figure:
    figure, panels = make_panels(layout, (1.15, 1), rows=2)
    bars, curves, *areas = panels
    series = [
        Bars(
            name,
            colour,
            [evaluations[own].simulated[name].return_ for own in streams],
            exact=[evaluations[own].exact[name].return_.estimate for own in streams],
        )
        for name, colour in BASELINES.items()
    ]
    series.append(Bars(TRUST.name, TRUST_COLOUR, [compute_mean_return(own) for own in streams.values()]))
    draw_bars(bars, tuple(streams), series, LABELS["return"])
    bars.set_xlabel("knowledge", fontsize=8)
    add_bar_legend(figure, series, layout=layout)
    _draw_returns(curves, evaluations, streams)
    for axes, name in zip(areas, WEIGHTS_SHOWN, strict=True):
        _draw_weights(axes, streams[name])
        axes.set_title(f"{name} knowledge", fontsize=8)
    figure.legend(
        *areas[0].get_legend_handles_labels(),
        loc="outside lower center",
        ncols=4 if layout == "wide" else 3,
        title="sources",
        title_fontsize=8,
        fontsize=8,
        frameon=False,
    )
    return figure


def _draw_returns(axes: Axes, evaluations: Evaluations, streams: Streams) -> None:
    """Draw the return of each block of people, and that of LCORPP, which does not learn, as a line."""
    for number, (name, own) in enumerate(streams.items()):
        ends = BLOCK * np.arange(1, len(own[0].returns) + 1)
        intervals = [compute_seed_interval([s.returns[k] for s in own]) for k in range(len(ends))]
        look = {"color": KNOWLEDGE[name], "ecolor": KNOWLEDGE[name], "label": name, "markersize": 3}
        draw_line(axes, ends - BLOCK / 2 + BLOCK / 8 * (number - 1), intervals, **look)
        level = evaluations[name].exact["LCORPP"].return_.estimate
        axes.axhline(level, color=KNOWLEDGE[name], linestyle="--", linewidth=1)
    handles, _ = axes.get_legend_handles_labels()
    handles.append(Line2D([], [], color=MUTED, linestyle="--", linewidth=1, label="LCORPP, exact"))
    axes.set_ylim(bottom=15)  # space for the legend
    axes.legend(handles=handles, fontsize=7, frameon=False, loc="lower center", ncols=2)
    axes.set_title(TRUST.name, fontsize=8)
    axes.set_xlim(0, ends[-1])
    axes.set_xlabel("people", fontsize=8)
    axes.set_ylabel(f"mean return of {BLOCK} people")
    axes.tick_params(labelsize=8)


def _draw_weights(axes: Axes, streams: Sequence[Stream]) -> None:
    """Draw the mean weights of the sources as areas."""
    sources = streams[0].sources
    weights = np.mean([stream.weights for stream in streams], axis=0)
    weights = np.vstack([streams[0].first_weights, weights])
    people = BLOCK * np.arange(len(weights))
    others = dict(zip((name for name in sources if name not in SOURCES), cycle(COLOURS), strict=False))
    shown = {name: colour for name, colour in {**SOURCES, **others}.items() if name in sources}
    areas = [weights[:, sources.index(name)] for name in shown]
    axes.stackplot(people, areas, labels=[*shown], colors=[*shown.values()], edgecolor="white", linewidth=0.5)
    axes.set_xlim(0, people[-1])
    axes.set_ylim(0, 1)
    axes.set_xlabel("people", fontsize=8)
    axes.set_ylabel("weight of each source")
    axes.tick_params(labelsize=8)
