"""What remains of each decision of Algorithm 1: its result, a record in the stores and a line of the log."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from lcorpp.assembly.robot_parts import RobotParts
from lcorpp.decision.lcorpp import sum_by_class
from lcorpp.domains import Domain
from lcorpp.logs.decision_log import DecisionLog
from lcorpp.runs.drift import DriftMonitor, agrees_with
from lcorpp.runs.run_store import RunStore
from lcorpp.runs.session import LearningSession
from lcorpp.simulation.people_stream import DecisionResult, PeopleStream
from lcorpp.values import Distribution, Episode, Instance


class DecisionRecorder:
    """Records the decisions about the people of a stream.

    parts: those that decide now, for the log; None without a log.
    trained: the senses whose classifiers that decide now are trained.
    """

    def __init__(
        self,
        domain: Domain,
        learning: Collection[str],
        stream: PeopleStream,
        monitor: DriftMonitor,
        run_store: RunStore | None,
        log: DecisionLog | None,
        session: LearningSession,
    ) -> None:
        """learning: the senses that learn. run_store: its decisions since the last batch are results, too.

        session: learns from each decision after it is recorded.
        """
        self._domain, self._learning, self._stream, self._monitor = domain, learning, stream, monitor
        self._run_store, self._log, self._session = run_store, log, session
        pending = run_store.pending if run_store is not None else ()
        self._results = [result for track in pending if (result := DecisionResult.from_stored(track))]
        self.parts: RobotParts | None = None
        self.trained: Collection[str] = ()

    def take_results(self) -> tuple[DecisionResult, ...]:
        """Return the results since the last call."""
        results, self._results = tuple(self._results), []
        return results

    def record(self, instance: Instance, episode: Episode) -> None:
        """Record the decision about the latest person; it is in the stores when this returns."""
        domain, report, session = self._domain, episode.report, self._session
        result = self._stream.result(episode)
        self._results.append(result)
        agrees = {
            name: agrees_with(label, domain.class_of(name, report))
            for name, label in episode.labels.items()
            if name in self.trained and report is not None
        }
        for name in self._learning:
            if name in instance.signals:
                self._monitor.add(name, instance.signals[name], agrees.get(name))
        if self._log is not None and self.parts is not None:
            truth = self._stream.describe_truth()
            strategy, person = session.strategy, session.n_people
            self._log.append(self.parts, strategy, instance.context, episode, truth, person=person)
        if self._run_store is not None:
            joint = domain.marginal(episode.steps[-1].belief if episode.steps else episode.prior)
            self._run_store.append_decision(
                instance.signals,
                instance.context,
                {name: None if report is None else domain.class_of(name, report) for name in self._learning},
                {name: find_class_marginal(domain, name, joint) for name in self._learning},
                episode.answers,
                {**result.to_extra(), "agrees": agrees, **session.describe_decision(episode)},
            )
        session.learn(episode)


def find_class_marginal(domain: Domain, sense: str, joint: Distribution) -> Distribution:
    """Return the distribution of the class that a sense should predict, from that of the shared variables."""
    classes = domain.find_sense(sense).classes
    probabilities = sum_by_class(domain, sense, joint)
    return Distribution(classes, np.array([probabilities.get(name, 0.0) for name in classes]))
