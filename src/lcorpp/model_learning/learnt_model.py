"""The model that episodes determine: a POMDP with named states, and an interval of each number."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from lcorpp.domains.sections.learning import Sense
from lcorpp.errors import DataError, ModelError
from lcorpp.model_learning.baum_welch import Parameters, Prior, expect
from lcorpp.model_learning.draws import average_models, draw_models
from lcorpp.model_learning.episode_records import add_evidence, make_records
from lcorpp.model_learning.episodes import Episodes
from lcorpp.model_learning.knowledge.knowledge import Knowledge, check_attributes, learn_knowledge
from lcorpp.model_learning.relations import list_answers
from lcorpp.model_learning.spaces import Space
from lcorpp.model_learning.states import learn
from lcorpp.model_learning.structure import Model, Structure
from lcorpp.planning import Pomdp, SparseTables
from lcorpp.values import Array

OVER = "over"
"""Name of the state after the end of a decision."""

MORE_STATES = 11
"""By default this many states may be added to one of each shared value."""


@dataclass(frozen=True, eq=False)
class StatedDomain:
    """What a domain states of a model that is learnt from its log.

    name: of the domain. reward: (A, K) of actions and states. senses: of the robot.
    strategy: whose decisions were read. skipped: why others were not -> how many.
    """

    name: str
    reward: Array
    senses: tuple[Sense, ...]
    strategy: str
    skipped: Mapping[str, int]


@dataclass(frozen=True, eq=False)
class LearntModel:
    """A model with what it was learnt from.

    states: (K,) names. pomdp: the states and `over`. draws: (D,) parameters from the posterior.
    knowledge: of the shared variables, facts and hidden attributes; None without shared variables.
    stated: the domain that states rewards and states; None if they are learnt.
    planned: the parameters by which it plans, if they are not the estimate.
    """

    episodes: Episodes
    space: Space
    model: Model
    states: tuple[str, ...]
    discount: float
    draws: tuple[Parameters, ...]
    knowledge: Knowledge | None
    stated: StatedDomain | None = None
    planned: Parameters | None = None

    def __repr__(self) -> str:
        return f"<LearntModel: {len(self.states)} states from {len(self.episodes)} episodes>"

    @property
    def plan(self) -> Parameters:
        """The parameters by which it plans."""
        return self.model.parameters if self.planned is None else self.planned

    @cached_property
    def pomdp(self) -> Pomdp:
        """The POMDP by which it plans."""
        own = self.plan
        return make_pomdp(self.episodes, self.states, own, self.find_rewards(own), self.discount)

    @cached_property
    def steps(self) -> Parameters:
        """Expected counts of steps from which each number was estimated."""
        return expect(self.episodes, self.model.parameters, self.model.structure.values).counts

    def find_interval(self, numbers: Callable[[Parameters], Array | float]) -> tuple[Array, Array]:
        """Return the ends of the 95 % intervals of some numbers of the parameters, from draws."""
        drawn = np.array([numbers(own) for own in self.draws], dtype=np.float64)
        # "weibull": between these quantiles of 39 or more draws are 95 % of further ones; of fewer draws they
        # are the extremes, between which are less
        low, high = np.quantile(drawn, [0.025, 0.975], axis=0, method="weibull")
        return low, high

    def find_rewards(self, parameters: Parameters) -> Array:
        """Return (A, K) the expected reward of each action in each state."""
        rewards: Array = parameters.reward @ self.episodes.reward_values
        return rewards if self.stated is None else self.stated.reward


def learn_model(
    episodes: Episodes,
    *,
    reports: str | None = None,
    hidden: Mapping[str, Sequence[str]] | None = None,
    order: Sequence[str] = (),
    discount: float = 0.95,
    max_states: int | None = None,
    draws: int = 100,
    seed: int = 0,
    progress: Callable[[float, int], None] = lambda _share, _states: None,
) -> LearntModel:
    """Learn a POMDP from episodes in which the states are hidden.

    The number of states, what each action does to the state, and which states are alike are chosen by the
    Bayesian information criterion; the numbers are means of draws from the posterior.

    Args:
        episodes: the data.
        reports: of `Space.of_reports`, e.g. ``report_{intention}``: the states are then the values of these
            variables, which do not change, and further ones that follow from actions. Without it, states
            have no names. A fact of the episodes that is one of these variables is its true value.
        hidden, order: of `learn_knowledge`, which learns how the shared variables and the facts depend on
            each other; only with reports.
        discount: of the model, from 0 to below 1.
        max_states: by default eleven more than there are shared values.
        draws: from the posterior, for intervals; at least 1.
        seed: of all random numbers.
        progress: takes the completed share of the work, at most, and the number of states of the model that
            was scored.

    Raises:
        DataError: the pattern does not fit to the actions, or facts, hidden attributes or the order do not
            fit to each other; there are some without reports.
        ModelError: an argument is out of range.

    Examples:
        >>> from lcorpp.model_learning import Episodes, Step, learn_model
        >>> heads, tails = Step("look", "h", -1), Step("look", "t", -1)
        >>> def end(action, reward): return Step(action, "none", reward)
        >>> people = [[heads, end("say_heads", 5)], [tails, end("say_heads", -5)],
        ...           [tails, end("say_tails", 5)], [heads, end("say_tails", -5)]] * 20
        >>> learnt = learn_model(Episodes.of(people, [True] * 80), reports="say_{side}")
        >>> learnt.states
        ('heads', 'tails')
        >>> look, h = learnt.pomdp.action_index("look"), learnt.pomdp.observations.index("h")
        >>> round(float(learnt.pomdp.observation[look][0, h]), 1)
        1.0
    """
    space = Space.unknown(episodes)
    if reports is not None:
        space = Space.of_reports(episodes, reports)
        answers = list_answers(space.variables, space.values, episodes.observation_names)
        episodes = episodes.add_observations(answers)
        space = space.relate(episodes)
    if reports is None and (hidden or order or any(episodes.facts)):
        raise DataError(
            "facts, hidden attributes and an order need reports: they relate to the shared values"
        )
    episodes = add_evidence(episodes, space)
    limit = len(space) + MORE_STATES if max_states is None else max_states
    if not 0 <= discount < 1:
        raise ModelError(f"the discount is {discount}; expected a number from 0 to below 1")
    if limit < len(space):
        raise ModelError(f"max_states is {limit}; expected at least {len(space)}, one of each shared value")
    if draws < 1:
        raise ModelError(f"draws is {draws}; expected at least 1")
    attributes = dict.fromkeys(name for own in episodes.facts for name in own)
    check_attributes([*space.variables, *attributes], hidden, order)
    rng = np.random.default_rng(seed)
    model = learn(episodes, space, limit, rng, progress)
    pseudo = Prior.of(episodes).pseudo_counts(model.parameters.count, space)
    drawn = tuple(draw_models(episodes, model, pseudo, draws, rng))
    model = average_models(episodes, model, drawn)
    knowledge = None
    if space.variables:
        names = [list(dict.fromkeys(own)) for own in zip(*space.values, strict=True)]
        knowledge = learn_knowledge(
            make_records(episodes, space, model),
            hidden=hidden,
            order=order,
            values=dict(zip(space.variables, names, strict=True)),
            seed=seed,
        )
    return LearntModel(
        episodes, space, model, name_states(space, model.structure), discount, drawn, knowledge
    )


def make_pomdp(
    episodes: Episodes, states: Sequence[str], parameters: Parameters, reward: Array, discount: float
) -> Pomdp:
    """Return a POMDP of K named states and `over`. reward: (A, K)."""
    A, K = len(episodes.action_names), len(states)
    transition, rewards = np.zeros((A, K + 1, K + 1)), np.zeros((A, K + 1))
    transition[:, :K], transition[:, K, K] = parameters.transition, 1.0
    rewards[:, :K] = reward
    return Pomdp(
        (*states, OVER),
        episodes.action_names,
        episodes.observation_names,
        SparseTables.of(transition),
        SparseTables.of(parameters.observation),
        rewards,
        discount,
        np.append(parameters.start, 0.0),
    )


def name_states(space: Space, structure: Structure) -> tuple[str, ...]:
    """Return names by the shared values, with the number of the state if a value has several."""
    values, numbers = structure.values, structure.numbers
    if not space.variables:
        return tuple(f"s{k + 1}" for k in range(len(values)))
    names = ["_".join(space.values[v]) for v in values]
    if max(numbers) == 1:
        return tuple(names)
    return tuple(f"{name}_{number}" for name, number in zip(names, numbers, strict=True))
