"""The beliefs that a domain's POMDP is solved for: those from which decisions begin."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from itertools import combinations_with_replacement, product
from math import comb, prod
from typing import Any, NamedTuple

import numpy as np

from lcorpp.domains.reasoners import make_reasoner
from lcorpp.domains.sections.learning import Sense
from lcorpp.domains.sections.planning import PlanningSection
from lcorpp.domains.sections.reasoning import ReasoningSection
from lcorpp.errors import NoValueError, ProgramError, TooLargeError, UndefinedError
from lcorpp.protocols import Reasoner as ReasonerProtocol
from lcorpp.values import Array

MAX_GRID_STEPS, MAX_PRIORS = 10, 36
"""Limits of the grid of priors in `list_start_beliefs`: grid steps from 0 to 1, and number of priors."""

MAX_EVIDENCES, MAX_EVIDENCE_PRIORS = 500, 64
"""Maximum numbers of combinations of facts and labels, and of the priors that follow from them."""


class StartBeliefs(NamedTuple):
    """Beliefs to solve a model for.

    beliefs: (N, S) the model's initial belief, and priors.
    labels_alone: (M, S) priors by the labels and the rates alone (L+P).
    are_complete: whether these are all priors of the stated program with labels as evidence.
    """

    beliefs: Array
    labels_alone: Array
    are_complete: bool


def list_start_beliefs(
    reasoning: ReasoningSection, senses: Sequence[Sense], planning: PlanningSection
) -> StartBeliefs:
    """Return the beliefs to solve the model for: its own initial belief, and priors.

    The prior differs from person to person, and a policy is only good near the beliefs it was computed
    for. The priors are a grid that covers the simplex, and the reasoner's marginals given each combination of
    facts and labels, if these are few. If they are many and a grid finer than the corners is too large, the
    marginals given the most probable observed facts are added instead. `solve(mixed=...)` is for all others.
    """
    n = len(reasoning.values)
    # the finest grid of at most MAX_PRIORS priors; one step gives a prior for each value, however many
    steps = max(m for m in range(1, MAX_GRID_STEPS + 1) if m == 1 or comb(m + n - 1, m) <= MAX_PRIORS)
    grid = [
        np.bincount(values, minlength=n) / steps for values in combinations_with_replacement(range(n), steps)
    ]
    marginals, labels_alone = _compute_all_marginals(reasoning, senses)
    are_complete = marginals is not None
    if marginals is None:
        marginals = np.zeros((0, n)) if steps > 1 else _compute_likely_marginals(reasoning, senses)
    corners = planning.initial_states
    beliefs = np.vstack([planning.pomdp.start, np.vstack([grid, marginals]) @ corners])
    return StartBeliefs(beliefs, labels_alone @ corners, are_complete)


def _compute_all_marginals(section: ReasoningSection, senses: Sequence[Sense]) -> tuple[Array | None, Array]:
    """Return the marginals of the shared variables given all facts, and a label of each sense or none.

    They are distinct, sorted, and rounded, see `_compute_likely_marginals`.

    Returns:
        (n, V) the marginals, and the one without evidence; None if they are too many, or the program has no
        circuit, e.g. because it is too large. (m, V) those by labels alone, if all values were equally
        probable before.
    """
    nothing = np.zeros((0, len(section.values)))
    choices: dict[str, list[str | None]] = {name: [*own] for name, own in section.observed_values.items()}
    choices |= {sense.attribute: [None, *sense.label_of.values()] for sense in senses}
    if not choices or prod(map(len, choices.values())) > MAX_EVIDENCES:
        return None, nothing
    infer = _make_inference(section, senses, choices)
    if infer is None:
        return None, nothing
    marginals = infer([[None] * len(choices), *product(*choices.values())])
    before = marginals[0]  # without evidence: not all facts can be observed of all people
    distinct = _find_distinct(marginals)
    if len(distinct) > MAX_EVIDENCE_PRIORS:
        return None, nothing
    no_facts = [None] * len(section.observed_values)
    labels = list(product(*[[None, *sense.label_of.values()] for sense in senses]))[1:]
    if not labels or np.isnan(before).any():
        return distinct, nothing
    given = infer([[*no_facts, *own] for own in labels])
    ratios = np.divide(given, before, out=np.zeros_like(given), where=before > 0)
    return distinct, _find_distinct(ratios / ratios.sum(axis=1, keepdims=True))


def _make_inference(
    section: ReasoningSection, senses: Sequence[Sense], choices: Mapping[str, Sequence[str | None]]
) -> Callable[[Sequence[Sequence[str | None]]], Array] | None:
    """Return the function from rows of evidence to the marginals (n, V), NaN where there is none.

    Args:
        choices: attribute -> its values in the rows, None for none.

    Returns:
        None if the program has no circuit, e.g. because it is too large.
    """
    if section.own_reasoners is not None:
        own = make_reasoner(section, senses, section.program)
        return partial(_infer_each, own, section, list(choices))
    from lcorpp.reasoning import Reasoner  # imports the grounder and the compiler

    try:
        circuit = Reasoner(section.program).compile(list(choices), [section.shared])
    except ProgramError:
        return None

    def infer(rows: Sequence[Sequence[str | None]]) -> Array:
        """(n, V) the marginals given rows of evidence; NaN where it is impossible, or there is no value."""
        columns: Any = dict(zip(choices, map(list, zip(*rows, strict=True)), strict=True))
        try:
            answers: Any = circuit(columns, undefined="nan")
        except NoValueError:
            single = np.full((1, len(section.values)), np.nan)
            return np.vstack([infer([row]) for row in rows]) if len(rows) > 1 else single
        (marginals,) = answers.values()
        return np.asarray(marginals)

    return infer


def _infer_each(
    reasoner: ReasonerProtocol,
    section: ReasoningSection,
    names: Sequence[str],
    rows: Sequence[Sequence[str | None]],
) -> Array:
    """Return the marginals (n, V) of rows of evidence about `names`, each computed alone."""
    marginals = np.full((len(rows), len(section.values)), np.nan)
    for marginal, row in zip(marginals, rows, strict=True):
        evidence = {name: value for name, value in zip(names, row, strict=True) if value is not None}
        with suppress(UndefinedError):
            answer = reasoner.posterior(section.subject, evidence)
            assert answer is not None
            marginal[:] = answer.probabilities
    return marginals


def _find_distinct(marginals: Array) -> Array:
    """Return the distinct rows (n, V) without NaN, rounded."""
    distinct: Array = np.unique(np.round(marginals[~np.isnan(marginals).any(axis=1)], 12), axis=0)
    return distinct


def _compute_likely_marginals(section: ReasoningSection, senses: Sequence[Sense]) -> Array:
    """Return the marginals (n, V) of the shared variables given each of the most probable observed facts.

    They are distinct, sorted, and rounded far above the reasoner's errors, so that programs that are
    equivalent get the same policy.
    """
    from lcorpp.reasoning import Reasoner  # imports the grounder and the compiler

    program, names = section.program, section.observed
    try:
        likely = Reasoner(program).most_probable(count=MAX_PRIORS, of=names) if names else ()
    except NoValueError:  # not all facts can be observed of all people
        likely = ()
    except TooLargeError:  # each marginal would take seconds of sampling
        return np.zeros((0, len(section.values)))
    rows = [[world.values[name] for name in names] for world in likely]
    reasoner = make_reasoner(section, senses, program)
    marginals = (
        _infer_each(reasoner, section, names, rows) if rows else _infer_each(reasoner, section, (), [()])
    )
    return _find_distinct(marginals)
