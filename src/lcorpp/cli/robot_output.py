"""Output of commands about a robot: its domain, classifier with error rates, solved POMDP, and scores."""

from __future__ import annotations

from decimal import ROUND_CEILING, Context
from math import ceil, floor, inf
from typing import TYPE_CHECKING

from lcorpp.cli import console

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from rich.table import Table
    from rich.text import Text

    from lcorpp.assembly.options import ClassifierOptions
    from lcorpp.assembly.senses import Senses, SenseSetup
    from lcorpp.domains import Domain
    from lcorpp.experiments.comparison import Comparison
    from lcorpp.experiments.result_folder import WrittenFiles
    from lcorpp.learning import EvaluationReport, PredictionSets
    from lcorpp.planning import Solution
    from lcorpp.scoring.metrics import Scores
    from lcorpp.values import Interval

STACKED, INLINE = "\n[{},{}]", " [{}, {}]"
"""Layouts of an interval after its estimate; below each other, six columns fit into 80 characters."""

MAX_NAME_WIDTH = 13
"""Characters of a strategy's name on one line: six scores with their intervals fit beside it into 80."""


def print_domain(domain: Domain) -> None:
    """Print the name, preset and description of a domain, and a reasoner of the user's own."""
    preset = f", preset {domain.preset}" if domain.preset else ""
    console.out.print(f"{domain.name}{preset}: {domain.description}", style="bold")
    if domain.reasoning.own_reasoners is not None:
        console.out.print(f"reasoner: {domain.reasoning.own_reasoners}")


def note_storage_problems(classifiers: Iterable[ClassifierOptions]) -> bool:
    """Print, before the training, why a classifier cannot be saved; return whether there is one."""
    from lcorpp.assembly.options import TrainingOptions

    trained = [options for options in classifiers if isinstance(options, TrainingOptions)]
    if not trained:
        return False
    from lcorpp.assembly.classifier_training import find_storage_problem  # imports scikit-learn

    problems = [problem for options in trained if (problem := find_storage_problem(options)) is not None]
    for problem in problems:
        console.print_note(f"the classifier will not be saved: {problem}")
    return bool(problems)


def print_scores(scores: Sequence[Scores], positive: str | None, trials: int | None) -> None:
    """Print one row of scores per strategy, and the differences to the reference strategy.

    Args:
        positive: the positive class, None for macro averages. trials: their number, None for exact scores.
    """
    from lcorpp.scoring.metrics import find_reference, get_format

    if scores[0].variables:
        metrics = "accuracy of each variable and of all"
    else:
        metrics = (
            f"F1, precision and recall of {positive!r}" if positive else "macro averages over all values"
        )
    rows = [
        [_format_interval(cell, get_format(name), STACKED) for name, cell in row.columns.items()]
        for row in scores
    ]
    if trials is not None:
        count = f"{trials} trials, 95% intervals in brackets"
    elif any("\n" in cell for cells in rows for cell in cells):
        count = "exact values, bounds in brackets where too many episodes are possible"
    else:
        count = "exact values"
    names = [row.strategy for row in scores]
    table = _make_score_table(f"{count}; {metrics}", names, ["strategy", *scores[0].columns])
    for name, cells in zip(names, rows, strict=True):
        table.add_row(name, *cells)
    console.out.print(table)
    if len(scores) > 1:
        reference = find_reference(scores)
        title = "differences on the same people" + ("" if trials is None else ", paired intervals")
        table = _make_score_table(title, names, [f"{reference.strategy} minus", "cost", "return"])
        for row in scores:
            if row is not reference:
                gaps = reference.subtract(row)
                cells = [_format_interval(gaps[name], ".2f", INLINE) for name in ("cost", "return")]
                table.add_row(row.strategy, *cells)
        console.out.print(table)


def print_limits(domain: Domain, comparison: Comparison) -> None:
    """Print the planned and the measured share of each limit of a domain, for each strategy with trials."""
    limits, scores = domain.planning.limits, comparison.scores
    measured = [row for row in scores if row.limits]
    if not limits or not measured:
        return
    names = [row.strategy for row in measured]
    table = _make_score_table(
        "limits, measured; 95% intervals", names, ["strategy", *(own.name for own in limits)]
    )
    table.add_row("at most", *(f"{own.bound:g}" for own in limits), style="dim")
    plan = comparison.plan
    if plan is not None:
        cells = [f"{plan.cells[f'planned_limit_{own.name}']:.4f}" for own in limits]
        table.add_row("planned", *cells, style="dim")
    for row in measured:
        shown = [
            _format_interval(row.limits[own.name], ".4f", INLINE) if own.name in row.limits else "-"
            for own in limits
        ]
        table.add_row(row.strategy, *shown)
    console.out.print(table)
    if plan is not None and plan.solution is not None:
        found = plan.solution
        console.out.print(
            f"LCORPP+limits: planned return {found.value:.4f}, discounted; at most {found.upper:.4f} within"
            f" the limits; {found.reason} after {found.seconds:.1f} s, {len(plan.policy.controller)} nodes"
        )


def _make_score_table(title: str, names: Sequence[str], columns: Sequence[str]) -> Table:
    """Return an empty table; its first column is for the names of strategies."""
    from rich import box
    from rich.table import Table

    table = Table(title=title, title_style="", title_justify="left", box=box.SIMPLE_HEAD)
    table.padding = 0
    longest = max(map(len, names))
    width = max(len(columns[0]), min(longest, MAX_NAME_WIDTH))
    table.add_column(columns[0], style="bold", min_width=width, overflow="fold")
    for name in columns[1:]:
        # in a narrow terminal numbers break, not names
        table.add_column(name, justify="right", min_width=len(name), overflow="fold")
    return table


def _format_interval(interval: Interval, number_format: str, layout: str) -> Text:
    """Return the estimate and the interval with one digit less, as `STACKED` or `INLINE`.

    Exact values have no interval, or bounds if the least likely episodes were left out.
    """
    from rich.text import Text

    text, digits = Text(f"{interval.estimate:{number_format}}"), int(number_format[1])
    low, high = interval.low, interval.high
    if interval.confidence == 1:  # bounds: rounded outwards, and left out if nothing of them is visible
        if high - low < 10.0 ** -(digits + 1):
            return text
        scale = 10.0 ** (digits - 1)
        low, high = floor(low * scale) / scale, ceil(high * scale) / scale
    elif low == high:
        return text
    ends = [f"{end:.{digits - 1}f}" for end in (low, high)]
    ends = [end.removeprefix("0") if end.startswith("0.") else end for end in ends]
    ends = ["1" if end == "1.00" else end for end in ends]  # no wider than other probabilities
    return text.append(layout.format(*ends), "dim")


def print_classifiers(domain: Domain, senses: Senses) -> None:
    """Print each classifier, with notes about its data."""
    for name, setup in senses.items():
        print_classifier(setup, name if len(domain.senses) > 1 else "")
        _print_presence(domain, name)
        for text in setup.notes:
            console.print_note(text)


def _print_presence(domain: Domain, sense: str) -> None:
    """Print whom a sense perceives, unless that is everyone."""
    presence = domain.simulation.presence.get(sense)
    if presence is None:
        return
    shares = ", ".join(
        f"{100 * p:.3g}%" + (f" where {presence.of} is {value}" if presence.of else " of the people")
        for value, p in presence.probability_of.items()
    )
    console.out.print(f"  {sense} perceives {shares}")


def _name_folds(report: EvaluationReport) -> str:
    """Return the kind of cross-validation."""
    from lcorpp.learning.evaluation.folds import FOLDS

    if report.people <= report.folds < report.cases:
        return "leave-one-person-out"
    return "five-fold" if report.folds == FOLDS else f"{report.folds}-fold"


def print_classifier(setup: SenseSetup, sense: str = "") -> None:
    """Print the error rates of a classifier and, if it was trained now, its evaluation.

    Args:
        sense: its name, if there are several.
    """
    title = f"classifier of {sense}" if sense else "classifier"
    if setup.trained is None:
        console.out.print(f"{title}: a noisy channel with the domain's rates")
        for actual, row in setup.rates.items():
            rates = ", ".join(f"{predicted} {rate:.3f}" for predicted, rate in row.items())
            console.out.print(f"  true class {actual}; predicted: {rates}")
        return
    report = setup.report
    if report is None:
        console.out.print(f"{title}: {setup.source}")
    else:
        console.out.print(
            f"{title}: {setup.source}, {_name_folds(report)} cross-validation on {report.source}:"
            f" {setup.n_tracks} {setup.unit} of {report.people} people; [95% intervals]"
        )
        console.out.print(f"  accuracy {report.accuracy}")
    for cells in setup.intervals:
        # several cases of a person are no independent draws, as the interval of a rate assumes
        has_intervals = report is None or report.cases == report.people
        shown = [str(rate.interval) if has_intervals else f"{rate.value:.3f}" for rate in cells]
        rates = ", ".join(f"{rate.predicted} {value}" for rate, value in zip(cells, shown, strict=True))
        text = f"  true class {cells[0].true} ({cells[0].cases} cases); predicted: {rates}"
        console.out.print(text)
    if report is not None:
        console.out.print(_make_report_table(report))
    if setup.evidence.name == "set" and setup.trained.prediction_sets is not None:
        console.out.print(_describe_sets(setup.trained.prediction_sets), markup=False)
    if setup.trained.threshold is not None:
        console.out.print(f"decision threshold: {setup.trained.threshold}")


def _describe_sets(sets: PredictionSets) -> str:
    covered = ", ".join(f"{name} {part}" for name, part in zip(sets.classes, sets.coverages, strict=True))
    return (
        f"prediction sets of coverage {sets.coverage:g}, out of fold; true class in the set: {covered}\n"
        f"  mean size {sets.mean_size:.2f}; don't know: {sets.full:.3f} with all classes,"
        f" {sets.empty:.3f} empty"
    )


def print_solution(solution: Solution, gap: float | None = None, *, precision: float = inf) -> None:
    """Print the bounds of a solution, and a warning with the remaining gap if it has not converged.

    Args:
        gap: the largest one at the priors of the people, None if unknown. precision: of the solver.
    """
    name = "SARSOP" if solution.solver == "sarsop" else f"solver {solution.solver}"
    lower = solution.policy.value(solution.pomdp.start)
    upper = lower + solution.gap(solution.pomdp.start)
    about_gap = "" if gap is None else f"{_describe_gap(gap)}; "
    cached = "; from the cache of policies (--no-cache solves again)" if solution.cached else ""
    console.out.print(
        f"{name}: value in [{lower:.3f}, {upper:.3f}] at the start belief; {about_gap}{solution.vectors}"
        f" vectors, {solution.seconds:.1f} s{cached}"
    )
    if not solution.converged:
        text, is_wide = describe_open_gap(solution)
        kept = "; this is the best policy so far" if solution.reason == "interrupted" else ""
        if is_wide:
            console.warn(
                f"{name} has not converged ({solution.reason}{kept}): a better one may exist; {text}"
            )
        else:
            console.print_note(f"{name} ended ({solution.reason}{kept}): {text}")
    elif gap is not None:
        _note_wide_gap(solution, gap, precision)


def print_search(domain: Domain) -> None:
    """Print the work of the search at each step with a generative model."""
    from lcorpp.planning import GenerativeModel  # tables do without

    search, model = domain.planning.search, domain.model
    assert search is not None
    assert isinstance(model, GenerativeModel)
    values = "bounds on values are estimates" if model.has_bounds else "values are estimates without bounds"
    console.out.print(f"search at each step: {search.describe(model)}; {values}")


SMALL_SHARE = 0.1
"""A gap up to this share of what planning gains needs no warning."""


def describe_open_gap(solution: Solution) -> tuple[str, bool]:
    """Return what a better policy may gain at most, and whether that is much of what planning gains."""
    from lcorpp.planning.evaluation.gap_share import compute_gap_share

    gap, share = solution.upper - solution.lower, compute_gap_share(solution)
    start = "" if solution.start_count == 1 else " from any start"
    text = f"no policy earns more than {gap:.4g} above this one{start}"
    if share is None:
        return text, True
    return f"{text}, {share:.1%} of what planning gains over repeating one action", share > SMALL_SHARE


PRIORS = "the priors of these people"


def print_gap(solution: Solution, gap: float | None, precision: float, priors: str = PRIORS) -> None:
    """Print the largest gap at some priors; other arguments as of `print_solution`."""
    if gap is not None:
        console.out.print(_describe_gap(gap, priors))
        _note_wide_gap(solution, gap, precision)


def _describe_gap(gap: float, priors: str = PRIORS) -> str:
    rounded_up = float(Context(prec=2, rounding=ROUND_CEILING).create_decimal_from_float(gap))
    return f"gap at {priors} at most {rounded_up:g}"


def _note_wide_gap(solution: Solution, gap: float, precision: float) -> None:
    """Print a note if the gap at a prior is above the precision of a search that has converged."""
    from lcorpp.planning.upper_bounds import MixtureBound

    if solution.converged and gap > precision:
        mixed = isinstance(solution.policy.upper_bound, MixtureBound)
        advice = "; with a longer --time-limit the search goes on" if mixed else ""
        console.print_note(
            f"the gap at a prior is above the precision {precision:g}, so a better policy for some people may"
            f" exist{advice}"
        )


def _make_report_table(report: EvaluationReport) -> Table:
    """Return a table with one column per class: AUC, Brier score, calibration and the best thresholds."""
    from rich import box
    from rich.table import Table

    table = Table("class", box=box.SIMPLE_HEAD)
    classes = report.classes
    for one in classes:
        table.add_column(one.name, justify="right", overflow="fold")
    rows = {
        "AUC": [str(one.auc) for one in classes],
        "Brier score": [str(one.raw.brier) for one in classes],
        "expected calibration error": [str(one.raw.ece) for one in classes],
        "  after calibration": [str(one.calibrated.ece) for one in classes],
        "  if perfectly calibrated": [f"{one.calibrated.ece_if_calibrated:.3f}" for one in classes],
    }
    for choices in zip(*(one.thresholds for one in classes), strict=True):
        rows[choices[0].label] = [f"{t.score:.3f} at threshold {t.probability:.3f}" for t in choices]
    for name, cells in rows.items():
        table.add_row(name, *cells)
    prevalence = ", ".join(f"{one.name} {one.thresholds[0].prevalence:.3g}" for one in classes)
    table.caption = f"best thresholds for the prevalence: {prevalence}"
    table.caption_justify = "left"
    return table


def print_written(written: WrittenFiles, *, noted: bool) -> None:
    """Print the files of a result folder. noted: whether a note says that a classifier cannot be saved."""
    if written.problem is not None and not noted:
        console.print_note(f"the classifier is not saved: {written.problem}")
    console.out.print("wrote " + ", ".join(str(path) for path in written.paths))
