"""The session of a run of Algorithm 1: which strategy decides, and the states of trust and of the alarm."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Any

from lcorpp.assembly.strategies.trust import TRUST, check_dialogue
from lcorpp.decision import LCORPP, Robot, Strategy
from lcorpp.decision.strategies import Rates
from lcorpp.domains import Domain
from lcorpp.errors import DecisionError
from lcorpp.logs.decision_log import format_labels, read_labels
from lcorpp.protocols import Planner
from lcorpp.reasoning import Reasoner
from lcorpp.runs.batches import Row
from lcorpp.runs.online_learners import AlarmLearner, OnlineLearner, TrustLearner
from lcorpp.runs.run_store import EVIDENCE, STRATEGY, RunStore
from lcorpp.runs.training import SenseTrainer
from lcorpp.trust import Finding
from lcorpp.values import ConfusionMatrix, Episode, Label, Step


class LearningSession:
    """The strategy that decides in a run, trust and the alarm, over batches and interruptions.

    An interrupted run continues exactly: from the state in the checkpoint, and the decisions stored since.
    Without a usable checkpoint the classifiers are trained again. Then trust and alarm learn from all stored
    decisions, without the labels of the senses that learn: those are of earlier classifiers.

    strategy: LCORPP or LCORPP+trust.

    Args:
        run_store: of the run, if it has one.
        trust, watch: whether the run has trust, and the alarm. listener: as of `AlarmLearner`.

    Raises:
        DecisionError: as `TrustLearner`. DomainError: they cannot follow the domain's dialogue.
    """

    def __init__(
        self,
        domain: Domain,
        planner: Planner,
        trainer: SenseTrainer,
        run_store: RunStore | None,
        *,
        trust: bool,
        watch: bool,
        listener: Callable[[int, Finding], None],
    ) -> None:
        self.strategy: Strategy = TRUST if trust else LCORPP
        self._domain, self._start, self._trainer, self._store = domain, planner.start, trainer, run_store
        self._trust = TrustLearner(domain, planner) if trust else None
        self._learners = dict[str, OnlineLearner]()
        if self._trust is not None:
            self._learners["trust"] = self._trust
        if watch:
            self._learners["alarm"] = AlarmLearner(domain, listener)
        if self._learners:
            check_dialogue(domain, [TRUST])
        self._has_begun = False

    @property
    def n_people(self) -> int | None:
        """Number of people that trust has learnt from; None without trust."""
        return None if self._trust is None or self._trust.trust is None else self._trust.trust.n_people

    def make_reasoner(self, confusions: Mapping[str, ConfusionMatrix]) -> Reasoner:
        """Return the reasoner after a training, and begin the decisions with its classifiers."""
        reasoner = self._trainer.make_reasoner(confusions)
        if self._learners:
            rates = self._trainer.compute_rates(confusions)
            if self._has_begun:
                for learner in self._learners.values():
                    learner.retrain(reasoner, rates)
            else:
                self._begin(reasoner, rates)
        return reasoner

    def change(self, full: Robot) -> Robot:
        """Return the robot for the next person."""
        if self._trust is None or self._trust.trust is None:
            return full
        trust = self._trust.trust
        return replace(full, reasoner=trust, planner=trust.make_planner())

    def learn(self, episode: Episode) -> None:
        """Learn from the decision about that person."""
        for learner in self._learners.values():
            learner.learn(episode.evidence, episode.steps)

    def describe_decision(self, episode: Episode) -> dict[str, Any]:
        """Return what learning needs of a decision besides its answers, to be stored as JSON."""
        if not self._learners:
            return {}
        return {STRATEGY: self.strategy.name, EVIDENCE: format_labels(episode.evidence)}

    def state(self) -> Mapping[str, Any] | None:
        """Return the state for a checkpoint as JSON; None if there is none, or not yet."""
        if not self._has_begun:
            return self._store.session if self._store and self._learners else None
        return {name: learner.state() for name, learner in self._learners.items()}

    def describe(self) -> Row:
        """Return the columns of a batch that ends."""
        columns: Row = {}
        for learner in self._learners.values():
            columns |= learner.describe()
        return columns

    def _begin(self, reasoner: Reasoner, rates: Rates) -> None:
        """Continue where the earlier run ended, if the store has one."""
        store = self._store
        states = store.session or {} if store else {}
        for name, learner in self._learners.items():
            state = states.get(name)
            try:
                learner.begin(reasoner, rates, state)
            except DecisionError as error:
                assert store is not None
                store.notes.append(f"{error}; {name} learns again from all stored decisions")
                state = None
                learner.begin(reasoner, rates, None)
            if state is None and store is not None:
                learning = {self._domain.find_sense(sense).attribute for sense in store.stores}
                for evidence, steps in self._read_decisions(store, pending=False):
                    known = {name: value for name, value in evidence.items() if name not in learning}
                    learner.learn(known, steps)
        for evidence, steps in self._read_decisions(store, pending=True) if store else ():
            for learner in self._learners.values():
                learner.learn(evidence, steps)
        self._has_begun = True

    def _read_decisions(
        self, store: RunStore, *, pending: bool
    ) -> Iterator[tuple[dict[str, Label], list[Step]]]:
        """Yield evidence and steps of the stored decisions since the last training, or of those before.

        The steps have no report, and the initial belief in place of theirs, which is not stored.
        """
        since = {track.id for track in store.pending}
        for track in store.store.snapshot():
            if EVIDENCE in track.extra and (track.id in since) == pending:
                steps = [Step(action, heard, self._start) for action, heard in track.extra["answers"]]
                yield read_labels(track.extra[EVIDENCE]), steps
