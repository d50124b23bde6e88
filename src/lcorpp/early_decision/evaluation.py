"""Exact returns of early decisions about held-out people: their streams are real, their answers summed over.

A person has facts, a true value and the predictions of a classifier for the own track, so that what a policy
watches is determined. The expectation over the answers in the dialogue is a sum, with the true feedback model
of the domain.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from lcorpp.decision import Robot
from lcorpp.domains import Domain
from lcorpp.early_decision.extension import OVER, WATCH
from lcorpp.early_decision.stream_model import ENDED, StreamModel
from lcorpp.errors import DataError, DecisionError
from lcorpp.learning import PredictionTimeline
from lcorpp.planning import Planner
from lcorpp.scoring.decision_graph import DecisionGraph
from lcorpp.scoring.decision_nodes import RoundedBeliefNodes
from lcorpp.scoring.episode_model import EpisodeModel
from lcorpp.scoring.episode_sums import sum_episodes
from lcorpp.simulation.people import Person
from lcorpp.values import Array, Distribution, Indices

DIGITS = 12
"""Beliefs are rounded to so many decimals, so that equal ones are found."""

MAX_DROPPED = 1e-8
"""Maximum probability of the decisions that are left out of a sum."""

MAX_TOGETHER = 200
"""Number of beliefs before a dialogue whose episodes are summed at once."""


@dataclass(frozen=True, eq=False)
class ObservedPeople:
    """n people with known truth: the facts as a prior, and the predictions for their tracks.

    priors: (n, V) the reasoner's marginal given the facts alone. values: (n,) index of the true value.
    timeline: the uncalibrated predictions of a classifier that was not trained on them.
    """

    priors: Array
    values: Indices
    timeline: PredictionTimeline

    def __post_init__(self) -> None:
        n = len(self.timeline.labels)
        if len(self.priors) != n or self.values.shape != (n,):
            raise DataError(f"{len(self.priors)} priors and {len(self.values)} values of {n} people")

    @classmethod
    def of(cls, domain: Domain, people: Sequence[Person], timeline: PredictionTimeline) -> ObservedPeople:
        """Infer the priors of people, one for each combination of facts."""
        reasoner = domain.make_reasoner(domain.program)
        facts = [tuple(person[name] for name in domain.observed) for person in people]
        prior_of = {}
        for own in dict.fromkeys(facts):
            evidence = domain.evidence(dict(zip(domain.observed, own, strict=True)), {})
            marginal = reasoner.posterior(domain.shared, evidence)
            assert marginal is not None
            prior_of[own] = marginal.probabilities
        values = [domain.values.index(domain.reasoning.join(person)) for person in people]
        return cls(np.array([prior_of[own] for own in facts]), np.array(values, np.intp), timeline)


@dataclass(frozen=True, eq=False)
class EarlyReturns:
    """What a strategy earns from each of n people.

    returns: (n,) the expected undiscounted return, without the cost of watching. seconds: (n,) watched.
    """

    returns: Array
    seconds: Array

    def subtract_cost(self, cost: float) -> Array:
        """(n,) the return minus the cost of a second times the seconds."""
        return self.returns - cost * self.seconds


def score_policy(
    domain: Domain, extended: Domain, planner: Planner, stream: StreamModel, people: ObservedPeople
) -> EarlyReturns:
    """Return what a policy of an extended domain earns; it decides itself how long to watch each person.

    Args:
        extended: `domain` with the stream, see `extend_domain`. planner: of its model.

    Raises:
        DecisionError: the policy watches although the stream is over.
        DataError: the timeline of the people does not fit the stream.
    """
    bins = stream.bin_tracks(people.timeline)
    names = [f"bin_{number}" for number in range(1, stream.n_bins + 1)]
    known: dict[tuple[int, ...], tuple[Array, str]] = {}
    priors, prior_of = np.unique(people.priors, axis=0, return_inverse=True)
    stops: dict[bytes, int] = {}
    found, seconds = np.empty(len(bins), np.intp), np.zeros(len(bins))
    for person, (root, row) in enumerate(zip(prior_of.ravel().tolist(), bins.tolist(), strict=True)):
        node: tuple[int, ...] = (root,)
        if node not in known:
            belief = extended.prior(Distribution(extended.values, priors[root]))
            known[node] = belief, planner.action(belief)
        for stage, shown in enumerate([*row, ENDED]):
            belief, action = known[node]
            if action != WATCH:
                break
            node = (*node, shown)
            if node not in known:
                observation = OVER if shown == ENDED else names[shown]
                belief = np.round(planner.update(belief, action, observation), DIGITS)
                known[node] = belief, planner.action(belief)
            seconds[person] = stream.seconds[min(stage, len(stream.seconds) - 1)]
        else:
            raise DecisionError("the policy watches although the stream is over; expected a better solution")
        found[person] = stops.setdefault(known[node][0].tobytes(), len(stops))
    # the dialogue is the same after any stage: the true states are those of the domain
    starts = np.zeros_like(extended.planning.initial_states)
    starts[:, : len(domain.pomdp.states)] = domain.planning.initial_states
    dialogue = replace(extended, planning=replace(extended.planning, initial_states=starts))
    returns = sum_dialogues(dialogue, planner, np.array([np.frombuffer(stop) for stop in stops]))
    return EarlyReturns(returns[found, people.values], seconds)


def score_evidence(
    domain: Domain, planner: Planner, people: ObservedPeople, likelihoods: Array, seconds: npt.ArrayLike
) -> EarlyReturns:
    """Return what a policy of the domain itself earns after evidence about each person, e.g. at a fixed age.

    Args:
        likelihoods: (n, V) of the evidence, by which the priors are multiplied; 1 for none.
        seconds: (n,) that it takes, or the same for all.
    """
    posteriors = people.priors * likelihoods
    posteriors = posteriors / posteriors.sum(axis=1, keepdims=True)
    beliefs = np.round(posteriors @ domain.planning.initial_states, DIGITS)
    different, of = np.unique(beliefs, axis=0, return_inverse=True)
    returns = sum_dialogues(domain, planner, different)[of.ravel(), people.values]
    return EarlyReturns(returns, np.broadcast_to(np.asarray(seconds, np.float64), returns.shape))


def sum_dialogues(domain: Domain, planner: Planner, beliefs: Array) -> Array:
    """Compute the expected undiscounted return of the actions from each belief on.

    Args:
        domain: the true states begin at its `initial_states`. beliefs: (n, S) of the robot.

    Returns:
        (n, V) the return for each true value.

    Raises:
        DecisionError: no policy reports soon enough for an exact sum.
    """
    model = EpisodeModel(domain)
    robot = Robot({}, domain.make_reasoner(domain.program), planner, domain)
    nodes = RoundedBeliefNodes(domain, robot)
    graph, v = DecisionGraph(domain, nodes), len(domain.values)
    numbers = graph.find_numbers([belief.tobytes() for belief in beliefs])
    returns = np.empty((len(beliefs), v))
    for begin in range(0, len(beliefs), MAX_TOGETHER):
        part = numbers[begin : begin + MAX_TOGETHER]
        roots = {(number, i * v + k): np.eye(v)[k] for i, number in enumerate(part) for k in range(v)}
        names = ["the policy"] * (len(part) * v)
        sums = sum_episodes(model, graph, roots, names)
        if any(own.dropped.sum() > MAX_DROPPED for own in sums):
            raise DecisionError("the dialogues branch too much for an exact sum; expected simulated trials")
        returns[begin : begin + MAX_TOGETHER] = np.reshape([own.return_ for own in sums], (-1, v))
    return returns
