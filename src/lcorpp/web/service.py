"""The service behind a served page: a trial's model, posteriors, predictions, judged trials and the log."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from lcorpp.assembly.strategies.limits import bind_limits
from lcorpp.decision import Robot, dt_control
from lcorpp.decision.dt_control import MAX_STEPS
from lcorpp.decision.strategies import make_generator
from lcorpp.errors import DomainError, LcorppError, expected_one_of
from lcorpp.learning import StreamingClassifier
from lcorpp.logs.decision_log import format_decision
from lcorpp.planning import Planner
from lcorpp.simulation.simulated_classifier import PrecomputedLabel
from lcorpp.values import Instance
from lcorpp.web.limits import draw_start_node
from lcorpp.web.model import make_model
from lcorpp.web.page_planner import PagePlanner
from lcorpp.web.requests import Request, RequestError, parse_request
from lcorpp.web.robot import PlayRobot
from lcorpp.web.trial import JudgedTrial
from lcorpp.worlds.scripted import EndOfStepsError, RepeatedWorld

Json = dict[str, Any]
Samples = Sequence[tuple[float, ...]]
Keep = Callable[[JudgedTrial], Mapping[str, Any]]
"""Takes a trial that a person has judged; returns {stored, batch}."""
MAX_TRACK = 10_000
"""Samples of a sense in a trial: more than a quarter of an hour at ten a second."""
PERSON = 0
"""The id of the only person in the stream of a trial."""


class Service:
    """Replies to the requests of one page, whose engine plays the trials.

    docs/guides/results/play.md has the protocol.

    A request that is refused changes nothing.

    Args:
        find_robot: returns the robot for the next trial; a trained classifier may have replaced it.
        keep: see `Keep`; None if nothing learns from judged trials.
        log: takes each decision that ends, as a line of the decision log.
        make_seed: returns the seed of the draws of the next trial, of LCORPP+limits.
    """

    def __init__(
        self,
        find_robot: Callable[[], PlayRobot],
        keep: Keep | None = None,
        log: Callable[[bytes], None] | None = None,
        make_seed: Callable[[], tuple[int, ...]] = lambda: (0,),
    ) -> None:
        self._find_robot, self._keep, self._log = find_robot, keep, log
        self._make_seed = make_seed
        self._seed: tuple[int, ...] = (0,)
        self._actions: dict[str, Callable[..., Json]] = {
            "start": self._start,
            "infer": self._infer,
            "samples": self._classify,
            "judge": self._judge,
            "log": self._append,
        }
        self._robot: PlayRobot | None = None
        self._streams: dict[str, StreamingClassifier] = {}
        self._counts: dict[str, int] = {}

    def handle(self, text: str | bytes) -> Json:
        """Return the reply to a request."""
        try:
            request = parse_request(text)
        except RequestError as error:
            return error.reply()
        return self.reply(request)

    def reply(self, request: Request) -> Json:
        """Return the reply to a checked request, as `handle`."""
        try:
            if self._robot is None and request.type != "start":
                raise RequestError("out_of_order", "there is no trial; expected `start` before")
            reply = self._actions[request.type](**request.fields)
        except RequestError as error:
            return RequestError(error.code, f"{request.type}: {error}", request.id).reply()
        except LcorppError as error:
            return RequestError("failed", f"{request.type}: {error}", request.id).reply()
        return {"id": request.id, **reply}

    @property
    def _own_robot(self) -> PlayRobot:
        assert self._robot is not None  # `reply` checks it
        return self._robot

    def _start(self) -> Json:
        """Begin a trial. The reply has the model of the robot unless the page has it already."""
        robot, self._seed = self._find_robot(), self._make_seed()
        is_new, self._robot = robot is not self._robot, robot
        self._streams = {
            name: StreamingClassifier.from_trained(trained) for name, trained in robot.classifiers.items()
        }
        self._counts = dict.fromkeys(self._streams, 0)
        model = describe(robot, learns=self._keep is not None) if is_new else None
        return {"type": "started", "model": model}

    def _infer(self, facts: Mapping[str, str], labels: Mapping[str, str]) -> Json:
        """Return what follows from facts and classes."""
        robot = self._own_robot
        try:
            evidence = {name: str(value) for name, value in robot.domain.evidence(facts, labels).items()}
            inference = robot.knowledge.infer(evidence)
        except LcorppError as error:
            raise RequestError("invalid", str(error)) from None
        reply = {"type": "posterior", "evidence": evidence, **inference.content}
        if robot.plan is not None:
            prior = robot.domain.planning.initial_states.T @ np.array(inference.content["shared"])
            reply["node"] = draw_start_node(robot.plan, evidence, prior, self._seed)
        return reply

    def _classify(self, sense: str, samples: Samples) -> Json:
        """Add samples to the track of a sense, and return its class."""
        self._check_samples(sense, samples, self._counts.get(sense, 0))
        streams = self._streams[sense]
        prediction = streams.push_many((time, PERSON, *values) for time, *values in samples)[PERSON]
        self._counts[sense] += len(samples)
        row = prediction.probabilities
        return {
            "type": "prediction",
            "points": prediction.points,
            "track": prediction.track,
            "probabilities": None if row is None else row.tolist(),
            "class": None if row is None else streams.classifier(PERSON).classify(np.zeros(1)),
        }

    def _check_samples(self, sense: str, samples: Samples, n_before: int = 0) -> None:
        if sense not in self._streams:
            raise RequestError("invalid", f"sense: {sense!r}; {expected_one_of(self._streams)} with tracks")
        if n_before + len(samples) > MAX_TRACK:
            raise RequestError("too_large", f"expected at most {MAX_TRACK} samples in a trial")
        inputs = self._streams[sense].inputs
        for sample in samples:
            if len(sample) != 1 + len(inputs):
                raise RequestError(
                    "invalid", f"samples: {len(sample)} numbers; expected time, {', '.join(inputs)}"
                )

    def _judge(self, facts: Mapping[str, str], samples: Mapping[str, Samples], value: list[str]) -> Json:
        """Keep a trial with its true shared value."""
        domain = self._own_robot.domain
        try:
            domain.evidence(facts, {})
        except DomainError as error:
            raise RequestError("invalid", str(error)) from None
        for sense, own in samples.items():
            self._check_samples(sense, own)
        known = {tuple(domain.reasoning.split(own).values()): own for own in domain.values}
        if tuple(value) not in known:
            raise RequestError(
                "invalid", f"value: {', '.join(value)}; {expected_one_of(list(map(', '.join, known)))}"
            )
        kept: Mapping[str, Any] = {"stored": 0, "batch": 0}
        if self._keep is not None:
            tracks = {name: samples.get(name, ()) for name in self._streams}
            kept = self._keep(JudgedTrial(facts, tracks, known[tuple(value)]))
        return {"type": "judged", **kept}

    def _append(
        self, facts: Mapping[str, str], labels: Mapping[str, str], steps: list[tuple[str, str | None]]
    ) -> Json:
        """Append a decision to the log: the library makes it again, and it must be the same.

        Nothing of the page but names reaches the log. Without a log there is nothing to do.
        """
        if self._log is None:
            return {"type": "logged"}
        if len(steps) > MAX_STEPS:
            raise RequestError("too_large", f"{len(steps)} steps; expected at most {MAX_STEPS}")
        parts, world = self._own_robot.parts, RepeatedWorld(steps)
        robot = self._make_robot(labels, [action for action, _ in steps])
        try:
            parts.domain.evidence(facts, labels)
            episode = dt_control(robot, Instance(dict.fromkeys(labels, np.zeros((1, 1))), facts), world)
        except EndOfStepsError:
            expected = world.expected or "the decision has not ended"
            raise RequestError("invalid", f"steps: {expected}; expected {world.action}") from None
        except LcorppError as error:
            raise RequestError("invalid", str(error)) from None
        if [(own.action, own.observation) for own in episode.steps] != steps:
            raise RequestError("invalid", "steps: expected those up to the report, and no more")
        strategy, timeless = self._own_robot.strategy, replace(episode, seconds={})
        self._log(format_decision(parts, strategy, facts, timeless, seed=self._seed))
        return {"type": "logged"}

    def _make_robot(self, labels: Mapping[str, str], actions: Sequence[str]) -> Robot:
        """Return the robot that makes a decision of the page again; actions: of the page."""
        own, parts = self._own_robot, self._own_robot.parts
        classifiers = {name: PrecomputedLabel(label) for name, label in labels.items()}
        robot = replace(parts.robot, classifiers=classifiers)
        if own.plan is not None:
            (strategy,) = bind_limits([own.strategy], own.plan)
            return strategy.robot(robot, make_generator(*self._seed))
        planner = PagePlanner(Planner(parts.alpha_policy, parts.domain.pomdp), actions)
        return replace(robot, planner=planner)


@lru_cache(maxsize=2)
def describe(robot: PlayRobot, *, learns: bool) -> Json:
    """Return `make_model` of a robot, which pages get one after another."""
    return make_model(robot, learns=learns)
