"""The beliefs that a domain's POMDP is solved for: those from which decisions begin."""

from __future__ import annotations

from itertools import combinations_with_replacement
from math import comb

import numpy as np

from lcorpp.domains.sections.planning import PlanningSection
from lcorpp.domains.sections.reasoning import ReasoningSection
from lcorpp.errors import NoValueError, TooLargeError
from lcorpp.values import Array

MAX_GRID_STEPS, MAX_PRIORS = 10, 36
"""Limits of the grid of priors in `list_start_beliefs`: grid steps from 0 to 1, and number of priors."""


def list_start_beliefs(reasoning: ReasoningSection, planning: PlanningSection) -> Array:
    """Return (N, S) beliefs to solve the model for: its own initial belief, and priors.

    The prior differs from person to person, and a policy is only good near the beliefs it was computed
    for. The priors are a grid that covers the simplex, hence every marginal that a reasoner may return.
    If a grid finer than the corners is too large, the reasoner's marginals given the most probable
    observed facts are added.
    """
    n = len(reasoning.values)
    # the finest grid of at most MAX_PRIORS priors; one step gives a prior for each value, however many
    steps = max(m for m in range(1, MAX_GRID_STEPS + 1) if m == 1 or comb(m + n - 1, m) <= MAX_PRIORS)
    grid = [
        np.bincount(values, minlength=n) / steps for values in combinations_with_replacement(range(n), steps)
    ]
    priors = np.array(grid if steps > 1 else [*grid, *_compute_likely_marginals(reasoning)])
    return np.vstack([planning.pomdp.start, priors @ planning.initial_states])


def _compute_likely_marginals(section: ReasoningSection) -> Array:
    """Return the marginals (n, V) of the shared variables given each of the most probable observed facts.

    They are distinct, sorted, and rounded far above the reasoner's errors, so that programs that are
    equivalent get the same policy.
    """
    from lcorpp.reasoning import Reasoner  # imports the grounder and the compiler

    reasoner, subject = Reasoner(section.program), list(section.shared)
    try:
        likely = reasoner.most_probable(count=MAX_PRIORS, of=section.observed) if section.observed else ()
    except NoValueError:  # not all facts can be observed of everybody
        likely = ()
    except TooLargeError:  # each marginal would take seconds of sampling
        return np.zeros((0, len(section.values)))
    facts = [world.values for world in likely] or [{}]
    marginals = [reasoner.posterior(subject, context).probabilities for context in facts]
    return np.unique(np.round(marginals, 12), axis=0)
