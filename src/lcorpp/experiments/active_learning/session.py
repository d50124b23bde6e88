"""The session of a run of Algorithm 1: which strategy decides, and the state of its trust."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

from lcorpp.decision import STRATEGIES, Robot, Strategy
from lcorpp.decision.strategies import Rates
from lcorpp.domains import Domain
from lcorpp.errors import DecisionError, check_type
from lcorpp.experiments.active_learning.batches import NOISE, WEIGHT, Row
from lcorpp.experiments.active_learning.run_store import EVIDENCE, RunStore
from lcorpp.experiments.active_learning.training import SenseTrainer
from lcorpp.experiments.decision_log import format_labels, read_labels
from lcorpp.experiments.strategies.trust import TRUST, check_followed
from lcorpp.experiments.trust.setup import set_up_trust
from lcorpp.planning import Planner
from lcorpp.protocols import Planner as PlannerProtocol
from lcorpp.reasoning import Reasoner
from lcorpp.trust import Trust
from lcorpp.values import ConfusionMatrix, Episode, Label, Step


class LearningSession:
    """The strategy that decides in a run of Algorithm 1, over batches and interruptions.

    With trust, an interrupted run goes on exactly: from the state in the checkpoint, and the decisions that
    are stored since. Without a usable checkpoint the classifiers are trained again. Then trust learns from
    all stored decisions, without the labels of the senses that learn: those are of earlier classifiers.

    strategy: LCORPP or LCORPP+trust.

    Args:
        run_store: of the run, if it has one.

    Raises:
        DecisionError: the planner is none of lcorpp's.
        DomainError: trust cannot follow the domain's dialogue.
    """

    def __init__(
        self,
        domain: Domain,
        planner: PlannerProtocol,
        trainer: SenseTrainer,
        run_store: RunStore | None,
        *,
        trust: bool,
    ) -> None:
        self.strategy: Strategy = TRUST if trust else STRATEGIES[-1]
        self._domain, self._planner, self._trainer, self._run_store = domain, planner, trainer, run_store
        self._trust: Trust | None = None
        if trust:
            check_type(planner, Planner, "the planner of a run with trust", DecisionError)
            check_followed(domain, [TRUST])

    @property
    def n_people(self) -> int | None:
        """Number of people that trust has learnt from; None without trust."""
        return self._trust.n_people if self._trust else None

    def make_reasoner(self, confusions: Mapping[str, ConfusionMatrix]) -> Reasoner:
        """Return the reasoner after a training, and begin the decisions with its classifiers."""
        reasoner = self._trainer.make_reasoner(confusions)
        if self.strategy is TRUST:
            rates = self._trainer.compute_rates(confusions)
            if self._trust is None:
                self._trust = self._resume(reasoner, rates)
            else:
                self._trust.retrain(reasoner, rates=rates)
        return reasoner

    def change(self, full: Robot) -> Robot:
        """Return the robot for the next person."""
        if self._trust is None:
            return full
        return replace(full, reasoner=self._trust, planner=self._trust.make_planner())

    def learn(self, episode: Episode) -> None:
        """Learn from the decision about that person."""
        if self._trust is not None:
            self._trust.learn(episode.evidence, episode.steps)

    def format_evidence(self, episode: Episode) -> dict[str, Any]:
        """Return what trust needs of a decision besides its answers, to be stored as JSON."""
        return {} if self._trust is None else {EVIDENCE: format_labels(episode.evidence)}

    def state(self) -> Mapping[str, Any] | None:
        """Return the state for a checkpoint as JSON; None without trust, and before the first decision."""
        if self._trust is None:
            return self._run_store.session if self._run_store else None
        return self._trust.state()

    def describe(self) -> Row:
        """Return the weights of trust's sources, and the noise of the answers, as columns of a batch."""
        if self._trust is None:
            return {}
        weights = zip(self._trust.sources, self._trust.weights.tolist(), strict=True)
        columns: Row = {WEIGHT + name.replace(" ", "_"): weight for name, weight in weights}
        return columns | {NOISE: self._trust.learnt.noise}

    def _resume(self, reasoner: Reasoner, rates: Rates) -> Trust:
        """Return trust as the earlier run left it, or a new one, with the classifiers of a reasoner."""
        trust, store = self._set_up_trust(reasoner, rates), self._run_store
        if store is None:
            return trust
        state = store.session
        if state is not None:
            try:
                trust.restore(state)
            except DecisionError as error:
                store.notes.append(f"{error}; trust learns again from all stored decisions")
                trust, state = self._set_up_trust(reasoner, rates), None
        if state is None:
            learning = {self._domain.find_sense(name).attribute for name in store.stores}
            for evidence, steps in self._read_decisions(store, pending=False):
                known = {name: value for name, value in evidence.items() if name not in learning}
                trust.learn(known, steps)
        trust.retrain(reasoner, rates=rates)
        for evidence, steps in self._read_decisions(store, pending=True):
            trust.learn(evidence, steps)
        return trust

    def _set_up_trust(self, reasoner: Reasoner, rates: Rates) -> Trust:
        assert isinstance(self._planner, Planner)
        return set_up_trust(self._domain, reasoner, self._planner, rates=rates)

    def _read_decisions(
        self, store: RunStore, *, pending: bool
    ) -> Iterator[tuple[dict[str, Label], list[Step]]]:
        """Yield evidence and steps of the stored decisions since the last training, or of those before.

        The steps have no report, and the initial belief in place of theirs, which is not stored.
        """
        since, belief = {track.id for track in store.pending}, self._planner.start
        for track in store.store.snapshot():
            if EVIDENCE in track.extra and (track.id in since) == pending:
                steps = [Step(action, heard, belief) for action, heard in track.extra["answers"]]
                yield read_labels(track.extra[EVIDENCE]), steps
