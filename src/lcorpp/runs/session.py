"""The session of a run of Algorithm 1: which strategy decides, and the states of trust and of the alarm."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

from lcorpp.assembly.strategies.trust import TRUST, check_dialogue
from lcorpp.decision import LCORPP, Robot, Strategy
from lcorpp.decision.strategies import Rates, Session
from lcorpp.domains import Domain
from lcorpp.errors import DecisionError, check_type
from lcorpp.logs.decision_log import format_labels, read_labels
from lcorpp.planning import Planner as PolicyPlanner
from lcorpp.protocols import Planner, Reasoner
from lcorpp.runs.batches import Row
from lcorpp.runs.run_store import EVIDENCE, STRATEGY, RunStore
from lcorpp.runs.training import SenseTrainer
from lcorpp.trust import Finding
from lcorpp.values import ConfusionMatrix, Episode, Label, Step


class LearningSession:
    """The strategy that decides in a run, trust and the alarm, over batches and interruptions.

    An interrupted run continues exactly: from the state in the checkpoint, and the decisions stored since.
    Without a usable checkpoint the classifiers are trained again. Then trust and alarm learn from all stored
    decisions, without the labels of the senses that learn: those are of earlier classifiers.

    n_people: number of people that the strategy has learnt from; None for one that does not.

    Args:
        run_store: of the run, if it has one.
        strategy: decides; one that learns from people, such as LCORPP+trust, has a session.
        watch: whether the run has the alarm. listener: as of `AlarmSession`.

    Raises:
        DecisionError: trust has a planner that is not one of lcorpp's.
        DomainError: they cannot follow the domain's dialogue.
    """

    def __init__(
        self,
        domain: Domain,
        planner: Planner,
        trainer: SenseTrainer,
        run_store: RunStore | None,
        *,
        strategy: Strategy,
        watch: bool,
        listener: Callable[[int, Finding], None],
    ) -> None:
        self.strategy = strategy
        self._domain, self._planner, self._trainer, self._store = domain, planner, trainer, run_store
        self._starts = dict[str, Callable[[Robot, Rates], Session]]()
        if self.strategy.start is not None:
            check_type(planner, PolicyPlanner, "the planner of a run with trust", DecisionError)
            self._starts["trust"] = self.strategy.start
        if watch:
            from lcorpp.runs.alarm_session import AlarmSession  # loads the faults of programs

            self._starts["alarm"] = lambda full, rates: AlarmSession(domain, full, listener)
        if self._starts:
            check_dialogue(domain, [TRUST])
        self._sessions = dict[str, Session]()  # from the first training on

    @property
    def n_people(self) -> int | None:
        trust = self._sessions.get("trust")
        return None if trust is None else trust.n_people

    def make_reasoner(self, confusions: Mapping[str, ConfusionMatrix]) -> Reasoner:
        """Return the reasoner after a training, and begin the decisions with its classifiers."""
        reasoner = self._trainer.make_reasoner(confusions)
        if self._starts:
            full = Robot({}, reasoner, self._planner, self._domain)
            rates = self._trainer.compute_rates(confusions)
            for session in self._sessions.values():
                session.retrain(full, rates)
            if not self._sessions:
                self._sessions = self._resume(full, rates)
        return reasoner

    def change(self, full: Robot) -> Robot:
        """Return the robot for the next person."""
        for session in self._sessions.values():
            full = session.robot(full)
        return full if self.strategy.start is not None else self.strategy.robot(full)

    def learn(self, episode: Episode) -> None:
        """Learn from the decision about that person."""
        for session in self._sessions.values():
            session.learn(episode.evidence, episode.steps)

    def describe_decision(self, episode: Episode) -> dict[str, Any]:
        """Return what learning needs of a decision besides its answers, to be stored as JSON."""
        own = {STRATEGY: self.strategy.name}
        if self._starts:
            return {**own, EVIDENCE: format_labels(episode.evidence)}
        return {} if self.strategy is LCORPP else own

    def state(self) -> Mapping[str, Any] | None:
        """Return the state for a checkpoint as JSON; None if there is none, or not yet."""
        if not self._sessions:
            return self._store.session if self._store and self._starts else None
        return {name: session.state() for name, session in self._sessions.items()}

    def describe(self) -> Row:
        """Return the columns of a batch that ends."""
        columns: Row = {}
        for session in self._sessions.values():
            columns |= session.describe()
        return columns

    def _resume(self, full: Robot, rates: Rates) -> dict[str, Session]:
        """Return the sessions that continue where the earlier run ended, if the store has one."""
        store, sessions = self._store, dict[str, Session]()
        states = store.session or {} if store else {}
        for name, start in self._starts.items():
            session, state = start(full, rates), states.get(name)
            if state is not None:
                try:
                    session.restore(state)
                except DecisionError as error:
                    assert store is not None
                    store.notes.append(f"{error}; {name} learns again from all stored decisions")
                    session, state = start(full, rates), None
            if state is None and store is not None:
                learning = {self._domain.find_sense(sense).attribute for sense in store.stores}
                for evidence, steps in self._read_decisions(store, pending=False):
                    known = {name: value for name, value in evidence.items() if name not in learning}
                    session.learn(known, steps)
            sessions[name] = session
        for evidence, steps in self._read_decisions(store, pending=True) if store else ():
            for session in sessions.values():
                session.learn(evidence, steps)
        return sessions

    def _read_decisions(
        self, store: RunStore, *, pending: bool
    ) -> Iterator[tuple[dict[str, Label], list[Step]]]:
        """Yield evidence and steps of the stored decisions since the last training, or of those before.

        The steps have no report, and the initial belief in place of theirs, which is not stored.
        """
        since = {track.id for track in store.pending}
        for track in store.store.snapshot():
            if EVIDENCE in track.extra and (track.id in since) == pending:
                steps = [Step(action, heard, self._planner.start) for action, heard in track.extra["answers"]]
                yield read_labels(track.extra[EVIDENCE]), steps
