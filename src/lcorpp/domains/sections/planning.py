"""The `[planning]` section of a domain: the POMDP, the shared values of its states, and the reports."""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING

from lcorpp.domains.sections.files import find_file, find_function
from lcorpp.domains.sections.names import check_declared
from lcorpp.domains.sections.reasoning import ReasoningSection
from lcorpp.domains.sections.states import check_template, read_states
from lcorpp.domains.toml import TomlTable
from lcorpp.errors import DomainError, ModelError, expected_one_of
from lcorpp.planning import Pomdp, SolverOptions
from lcorpp.planning.formats.model_file import read_model
from lcorpp.user_code import UserFunction
from lcorpp.values import Array, SharedValue, format_value

if TYPE_CHECKING:
    from lcorpp.domains.sections.answers import StatedAnswers
    from lcorpp.domains.sections.limits import DomainLimit
    from lcorpp.planning import Factored, GenerativeModel, SearchOptions


def read_planner_model(
    table: TomlTable, folder: Path, reasoning: ReasoningSection
) -> tuple[Pomdp | GenerativeModel, Factored | None]:
    """Read the key `model`: a .pomdp or .pomdpx file, or ``FILE.py:NAME``.

    The function or class NAME returns a `Pomdp`, a `Factored` or an `Interaction`. If it has a parameter, it
    is called with the values of the shared variables: ``{"item": ("cup", "pen"), ...}``.

    Returns:
        The flat model, and its variables if it has them.

    Raises:
        DomainError: the function fails, or returns something else; or the discount is 1.
        FileError, ParseError, ModelError: the file is wrong, or the flat model too large.
    """
    pomdp, problem = _read_model(table, folder, reasoning)
    if pomdp.discount == 1:
        raise DomainError(
            f"{table.location('model')}: the discount of {pomdp.file} is 1; expected one below 1: a dialogue"
            " may go on forever"
        )
    return pomdp, problem


def _read_model(
    table: TomlTable, folder: Path, reasoning: ReasoningSection
) -> tuple[Pomdp | GenerativeModel, Factored | None]:
    name = table.text("model")
    parts = find_function(table, "model", folder)
    if parts is None and name.endswith(".py"):
        raise DomainError(f"{table.location('model')}: {name!r} names no function; expected {name}:NAME")
    if parts is None:
        return read_model(find_file(table, "model", folder))
    from lcorpp.planning import Factored, flatten  # files without variables do without

    function = UserFunction(*parts, DomainError)
    values = {shared: reasoning.program.attributes[shared].values for shared in reasoning.shared}
    arguments = (values,) if _has_parameter(function) else ()
    model = function(*arguments)
    if isinstance(model, Pomdp):
        return replace(model, file=function.location), None
    if not isinstance(model, Factored):
        if callable(getattr(model, "step", None)):
            from lcorpp.planning import GenerativeModel  # tables do without

            return GenerativeModel(model, reasoning.values, (function, arguments)), None
        raise DomainError(
            f"{table.location('model')}: {function.location}: {function.name}() returned"
            f" {type(model).__name__}; expected a Pomdp, a Factored, or an object with a method step"
        )
    problem = replace(model, file=function.location)
    try:
        return flatten(problem), problem
    except ModelError as error:
        raise ModelError(f"{function.location}: {error}") from None


def _has_parameter(function: UserFunction) -> bool:
    """Whether the user's function takes the values of the shared variables."""
    try:
        return bool(inspect.signature(function.function).parameters)
    except (TypeError, ValueError):  # a function without a signature, e.g. of C
        return False


SEARCH_KEYS = ("simulations", "particles", "widening", "expansions", "samples")
"""Keys of a generative model, see `lcorpp.domains.sections.generative`."""

MIN_LIMIT = 1e-9
"""Minimum of a solver's precision and time limit."""

MAX_PRECISION = 1e300
"""Maximum of a solver's precision; every finite gap is smaller."""


@dataclass(frozen=True, eq=False, repr=False)
class PlanningSection:
    """What the robot plans with: M of the paper. A POMDP state is a shared value with local variables.

    model: a POMDP with S states, or a generative model, whose states are the V shared values and the end.
    reports: report action -> shared value.
    initial_states: (V, S) the probability of each state, given shared value v, before the first action.
    state_values: (S, V) 1 if a state has shared value v; zeros for terminal states.
    terminal: the indices of the terminal states.
    solver: the solver of the model, and its limits.
    problem: the model with its variables, None if it has none.
    phrases: action or observation -> its text for people; without one its name is shown.
    utterances: observation -> the sentences by which people give it, for a recogniser, in lower case.
    recogniser: the file of what `lcorpp observe` learnt of the recogniser, for this model; None without.
    answers: the stated form of answers, whose memory is in the states; None if answers are independent.
    search: the work of the search at each step with a generative model; None for a POMDP.
    limits: what the robot must not do too often, for the strategy LCORPP+limits.
    limit_noise: of the answers, with which the limits hold; () for that of the model.

    Examples:
        >>> from lcorpp import load_domain
        >>> load_domain("intention").planning.reports
        {'report_interested': 'interested', 'report_not_interested': 'not_interested'}
    """

    model: Pomdp | GenerativeModel
    reports: Mapping[str, SharedValue]
    initial_states: Array
    state_values: Array
    terminal: tuple[int, ...]
    solver: SolverOptions
    problem: Factored | None = None
    phrases: Mapping[str, str] = field(default_factory=dict)
    utterances: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    recogniser: Path | None = None
    answers: StatedAnswers | None = None
    search: SearchOptions | None = None
    limits: tuple[DomainLimit, ...] = ()
    limit_noise: tuple[float, ...] = ()

    def __repr__(self) -> str:
        return f"PlanningSection({self.model!r}, reports: {', '.join(self.reports)})"

    @property
    def pomdp(self) -> Pomdp:
        """The model with its tables.

        Raises:
            DomainError: the model is generative.
        """
        if not isinstance(self.model, Pomdp):
            raise DomainError(
                f"{self.model.file}: the model is simulated, without the tables that are needed here;"
                " expected a .pomdp file, or a function that returns a Pomdp or a Factored"
            )
        return self.model


def read_planning(
    table: TomlTable, folder: Path, reasoning: ReasoningSection, *, own_solver: bool = True
) -> PlanningSection:
    """Read the section and the POMDP.

    Args:
        own_solver: whether to load a solver of the folder; SARSOP takes its place.

    Raises:
        DomainError: the states do not match the shared variables, a name is unknown, or the user's function
            that makes the model fails.
    """
    model, problem = read_planner_model(table, folder, reasoning)
    search = None
    if isinstance(model, Pomdp):
        table.reject_keys(SEARCH_KEYS, f"{model.file} has tables, which a solver takes")
    if problem is not None and isinstance(model, Pomdp) and "states" not in table:
        from lcorpp.domains.sections.state_variables import match_variables  # patterns do without

        states = match_variables(table, model, problem, reasoning)
    elif isinstance(model, Pomdp):
        states = read_states(table, model, reasoning)
    else:
        from lcorpp.domains.sections.generative import map_values, read_search

        states, search = map_values(model), read_search(table, model)
    reports = _read_reports(table, model, reasoning)
    solver = _read_solver(table, folder, own_solver)
    phrases, utterances, recogniser, answers = _read_phrases(table, model), {}, None, None
    if "utterances" in table or "recogniser" in table:
        from lcorpp.domains.sections.speech import read_recogniser, read_utterances  # few domains have them

        utterances, recogniser = read_utterances(table, model), read_recogniser(table, folder)
    if "answers" in table:
        from lcorpp.domains.sections.answers import read_answers  # few domains state a form

        answers = read_answers(table.section("answers"), len(model.observations))
        table.reject_keys(("limit_noise",), "answers have a form, whose noise is its own")
    limits: tuple[DomainLimit, ...] = ()
    limit_noise: tuple[float, ...] = ()
    if "limits" in table:
        from lcorpp.domains.sections.limits import read_limits  # few domains have them

        limits, limit_noise = read_limits(table, model, reasoning, reports)
    table.reject_unknown_keys()
    return PlanningSection(
        model=model,
        reports=reports,
        initial_states=states.initial_states,
        state_values=states.state_values,
        terminal=states.terminal,
        solver=solver,
        problem=problem,
        phrases=phrases,
        utterances=utterances,
        recogniser=recogniser,
        answers=answers,
        search=search,
        limits=limits,
        limit_noise=limit_noise,
    )


def _read_phrases(table: TomlTable, model: Pomdp | GenerativeModel) -> dict[str, str]:
    """Read `phrases`: action or observation -> its text for people."""
    section, known = table.section("phrases"), (*model.actions, *model.observations)
    for name in section:
        if name not in known:
            raise DomainError(
                f"{section.location(name)}: {model.file} has no action or observation {name!r};"
                f" {expected_one_of(known)}"
            )
    return {name: section.text(name) for name in section}


def _read_solver(table: TomlTable, folder: Path, own: bool) -> SolverOptions:
    """Read `solver`, a name or ``FILE.py:NAME`` in the folder, and its limits."""
    default = SolverOptions()
    name = table.text("solver", default.name)
    parts = find_function(table, "solver", folder) if "solver" in table else None
    precision = table.number("precision", MIN_LIMIT, MAX_PRECISION, default.precision)
    time_limit = table.number("time_limit", MIN_LIMIT, inf, default.time_limit)
    step_seconds = table.number("step_seconds", MIN_LIMIT, MAX_PRECISION, default.step_seconds)
    if parts and not own:
        return SolverOptions(precision=precision, time_limit=time_limit, step_seconds=step_seconds)
    try:
        return SolverOptions(f"{parts[0]}:{parts[1]}" if parts else name, precision, time_limit, step_seconds)
    except ModelError as error:
        raise DomainError(f"{table.location('solver')}: {error}") from None


def _read_reports(
    table: TomlTable, model: Pomdp | GenerativeModel, reasoning: ReasoningSection
) -> dict[str, SharedValue]:
    """Read `reports`: a template of the report actions, or a table action -> value (of several: a list)."""
    reports: dict[str, SharedValue] = {}
    if table.is_text("reports"):
        template, location = table.text("reports"), table.location("reports")
        check_template(table, "reports", template, set(reasoning.shared))
        for value in reasoning.values:
            action = template.format_map(reasoning.split(value))
            check_declared(location, action, model, "actions")
            if action in reports:
                raise DomainError(f"{location}: {template!r} makes {action!r} twice")
            reports[action] = value
        return reports
    section = table.section("reports", required=True)
    for action in section:
        location = section.location(action)
        check_declared(location, action, model, "actions")
        one = len(reasoning.shared) == 1
        names = (section.text(action),) if one else section.names(action, distinct=False)
        if len(names) != len(reasoning.shared):
            raise DomainError(
                f"{location}: {list(names)} has {len(names)} values; expected one for each of"
                f" {', '.join(reasoning.shared)}"
            )
        for attribute, value in zip(reasoning.shared, names, strict=True):
            reasoning.check_value(location, attribute, value)
        reports[action] = reasoning.join(dict(zip(reasoning.shared, names, strict=True)))
    reported = set(reports.values())
    for value in reasoning.values:
        if value not in reported:
            raise DomainError(f"{table.location('reports')}: no action reports {format_value(value)!r}")
    return reports
