"""A domain with `watch` as an action: the planner chooses between the stream and the dialogue."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lcorpp.arguments import check_arguments
from lcorpp.domains import Domain
from lcorpp.domains.sections.learning import Sense
from lcorpp.early_decision.stream_model import StreamModel
from lcorpp.errors import DomainError
from lcorpp.planning import Pomdp, SparseTables
from lcorpp.values import Array

WATCH = "watch"
"""The action that waits for the next stage of the stream."""

OVER = "stream_over"
"""The observation that the stream has ended: the track has, or the dialogue has begun."""

COST = 1.0
"""Default cost of a second, in reward units: the costs of the domain `intention` are seconds."""


DISCOUNT = 0.999
"""Default discount of a step of the model. That of a domain is for a question of some seconds. A stage may
take a third of a second, and its cost is stated in the reward: with .99 a step of watching costs 1 % of the
final report beside its seconds, more than most are worth."""


@check_arguments
def extend_domain(
    domain: Domain,
    stream: StreamModel,
    *,
    cost: float = COST,
    discount: float | None = DISCOUNT,
    sense: str | None = None,
) -> Domain:
    """Return a domain whose planner also chooses how long to watch a person before the dialogue.

    The model has a further state for each state in which a decision may begin, stage and bin: stage and bin
    are observed, so that it is a model of mixed observability. `watch` leads to the next stage, its
    observation is the new bin, e.g. `bin_3`, and its cost the seconds between the stages. Any other action
    does what it does in the domain, and ends the watching, as the person then reacts to the robot. Once the
    stream is over, also after the last stage or the end of the track, `watch` wastes its cost and is
    answered by `stream_over`.

    The stream takes the place of the sense's label: the prior comes from the facts alone, so the robot has no
    classifier of this sense. Its program, knowledge and reports remain. Simulated people have a stream of the
    model; `StreamWorld` is the world of a person with a classifier.

    Args:
        stream: the predictions of the sense's classifier.
        cost: of a second of watching, in reward units.
        discount: of a step, watching or not; None keeps that of the domain.
        sense: its name; None takes the only one.

    Raises:
        ModelError: the discount is not between 0 and 1.
        DomainError: the domain has no or several senses and none is named, the sense classifies no shared
            variable or other classes than the stream, the cost is not positive, or a name is taken.

    Source: the factored belief of a model of mixed observability, Ong, Png, Hsu and Lee, IJRR 29, 2010.
    """
    found = _find_sense(domain, sense)
    if set(found.classes) != set(stream.classes):
        raise DomainError(
            f"the stream has the classes {', '.join(stream.classes)}; expected those of the sense"
            f" {found.name!r}: {', '.join(found.classes)}"
        )
    if not 0 < cost < np.inf:
        raise DomainError(f"a second of watching costs {cost!r}; expected a positive number")
    base, planning = domain.pomdp, domain.planning
    bins = tuple(f"bin_{number}" for number in range(1, stream.n_bins + 1))
    for kind, names, known in (
        ("action", (WATCH,), base.actions),
        ("observation", (*bins, OVER), base.observations),
    ):
        for name in names:
            if name in known:
                raise DomainError(f"{base.file or domain.folder}: {name!r} is already an {kind} of the model")
    layout = _Layout(domain, stream, found)
    a, s, o = len(base.actions), len(base.states), len(base.observations)

    def extend_transition(own: SparseTables) -> SparseTables:
        dense = np.zeros((a + 1, layout.size, layout.size))
        dense[:a, :, :s] = own.dense[:, layout.origin]
        dense[a] = layout.build_transition()
        return SparseTables.of(dense)

    observation = np.zeros((a + 1, layout.size, o + len(bins) + 1))
    observation[:a, :, :o] = base.observation.dense[:, layout.origin]
    observation[a, np.arange(layout.size), o + layout.shown] = 1
    reward = np.zeros((a + 1, layout.size))
    reward[:a] = base.reward[:, layout.origin]
    reward[a] = -cost * layout.find_durations()
    reward[a, list(planning.terminal)] = 0
    initial = np.zeros((len(domain.values), layout.size))
    initial[:, layout.begin] = planning.initial_states[:, layout.starts]
    start = base.start.copy()
    start[layout.starts] = 0
    pomdp = Pomdp(
        (*base.states, *layout.names),
        (*base.actions, WATCH),
        (*base.observations, *bins, OVER),
        extend_transition(base.transition),
        SparseTables.of(observation),
        reward,
        base.discount if discount is None else discount,
        np.concatenate([start, base.start[layout.starts], np.zeros(layout.size - s - len(layout.starts))]),
        base.file,
    )
    feedback = observation.copy()
    feedback[:a, :, :o] = domain.simulation.feedback_model[:, layout.origin]
    hearing = np.tile(np.eye(len(pomdp.observations)), (a + 1, 1, 1))
    hearing[:a, :o, :o] = domain.simulation.hearing
    return replace(
        domain,
        planning=replace(
            planning,
            model=pomdp,
            initial_states=initial,
            state_values=planning.state_values[layout.origin],
            problem=None,
        ),
        simulation=replace(
            domain.simulation,
            feedback_model=feedback,
            hearing=hearing,
            transition=None
            if domain.simulation.transition is None
            else extend_transition(domain.simulation.transition),
        ),
    )


class _Layout:
    """The states of the extended model: those of the domain, then those of each stage.

    starts: the domain's states in which a decision may begin; each has a state before the stream, and one for
    each stage and bin. origin: (S',) the domain's state with the same dialogue. begin: the states before the
    stream. shown: (S',) the observation of `watch` that leads to a state: its bin, or B without a stream.
    """

    def __init__(self, domain: Domain, stream: StreamModel, sense: Sense) -> None:
        base, initial = domain.pomdp, domain.planning.initial_states
        self._stream, self._n = stream, len(base.states)
        self.starts = np.flatnonzero(
            initial.any(axis=0) & ~np.isin(np.arange(self._n), domain.planning.terminal)
        )
        values = domain.planning.state_values[self.starts].argmax(axis=1)
        classes = [domain.class_of(sense.name, domain.values[value]) for value in values]
        self._classes = np.array([stream.classes.index(name) for name in classes])
        k, b, m = len(stream.points), stream.n_bins, len(self.starts)
        self.size = self._n + m * (1 + k * b)
        self.begin = self._n + np.arange(m)
        # (K, B, m) the state of each stage and bin
        self._state = self._n + m + np.arange(k * b * m).reshape(k, b, m)
        self.origin = np.concatenate([np.arange(self._n), np.tile(self.starts, 1 + k * b)])
        bins = np.broadcast_to(np.arange(b)[None, :, None], (k, b, m)).ravel()
        self.shown = np.concatenate([np.full(self._n + m, b), bins])
        named = [base.states[start] for start in self.starts.tolist()]
        self.names = [f"{name}_before" for name in named]
        self.names += [
            f"{name}_stage_{i + 1}_bin_{j + 1}" for i in range(k) for j in range(b) for name in named
        ]

    def build_transition(self) -> Array:
        """(S', S') of `watch`."""
        stream, own = self._stream, self._classes
        matrix = np.eye(self.size)  # the domain's own states stay, and those of the last stage, below
        watching = np.arange(self._n, self.size)
        matrix[watching, watching] = 0
        every = np.arange(len(self.starts))
        ends = stream.ends[:, own]  # (K, m)
        matrix[self.begin, self.starts] = ends[0]
        matrix[self.begin[:, None], self._state[0].T] = (1 - ends[0])[:, None] * stream.first[own]
        for k in range(len(stream.points) - 1):
            for b in range(stream.n_bins):
                here = self._state[k, b]
                matrix[here, self.starts] = ends[k + 1]
                matrix[here[:, None], self._state[k + 1].T] = (1 - ends[k + 1])[:, None] * stream.steps[
                    k, own, b
                ]
        last = self._state[-1]
        matrix[last, np.broadcast_to(self.starts[every], last.shape)] = 1
        return matrix

    def find_durations(self) -> Array:
        """(S',) the seconds of `watch` in each state; without a next stage those of the last one."""
        durations = self._stream.durations
        k, b, m = self._state.shape
        next_stage = np.minimum(np.arange(1, k + 1), k - 1)
        staged = np.broadcast_to(durations[next_stage][:, None, None], (k, b, m)).ravel()
        return np.concatenate([np.full(self._n, durations[-1]), np.full(m, durations[0]), staged])


def _find_sense(domain: Domain, name: str | None) -> Sense:
    if name is not None:
        return domain.find_sense(name)
    if len(domain.senses) != 1:
        names = ", ".join(sense.name for sense in domain.senses) or "none"
        raise DomainError(f"{domain.folder}/domain.toml: the senses are {names}; expected one, or its name")
    return domain.senses[0]
