"""The engine of the page in Python: one session plays one trial after another."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from lcorpp.decision import LCORPP
from lcorpp.decision.dt_control import MAX_STEPS, infer_prior
from lcorpp.errors import (
    DataError,
    DomainError,
    LcorppError,
    ObservationError,
    UndefinedError,
    expected_one_of,
)
from lcorpp.learning import StreamingClassifier
from lcorpp.logs.decision_log import format_decision
from lcorpp.values import Belief, Episode, SharedValue, Step
from lcorpp.web.description import describe_domain, list_hearing
from lcorpp.web.requests import Request, RequestError, parse_request
from lcorpp.web.robot import PlayRobot
from lcorpp.web.trial import JudgedTrial
from lcorpp.web.view import draw_fan, list_belief, view_belief

Json = dict[str, Any]
Keep = Callable[[JudgedTrial], Mapping[str, Any]]
"""Takes a trial that a person has judged; returns {stored, batch}."""
MAX_TRACK = 10_000
"""Samples of a sense in a trial: more than a quarter of an hour at ten a second."""
PERSON = 0
"""The id of the only person in the stream of a trial."""


class Session:
    """Replies to the requests of one page; docs/play.md has the protocol.

    It draws nothing at random: the page sends every random number.

    Args:
        find_robot: returns the robot for the next trial; a trained classifier may have replaced it.
        keep: see `Keep`; None if the engine does not learn.
        log: takes each decision that ends, as a line of the decision log.
    """

    def __init__(
        self,
        find_robot: Callable[[], PlayRobot],
        keep: Keep | None = None,
        log: Callable[[bytes], None] | None = None,
    ) -> None:
        self._find_robot, self._keep, self._log = find_robot, keep, log
        self._actions: dict[str, Callable[..., Json]] = {
            "hello": self._hello,
            "start": self._start,
            "observe": self._observe,
            "samples": self._add_samples,
            "decide": self._decide,
            "answer": self._answer,
            "judge": self._judge,
            "record": self._record,
        }
        self._reset()

    def handle(self, text: str | bytes) -> Json:
        """Return the reply to a request; a refused one changes nothing."""
        try:
            request = parse_request(text)
        except RequestError as error:
            return error.reply()
        return self.reply(request)

    def reply(self, request: Request) -> Json:
        """Return the reply to a checked request, as `handle`."""
        try:
            reply = self._actions[request.type](**request.fields)
        except RequestError as error:
            return RequestError(error.code, f"{request.type}: {error}", request.id).reply()
        except LcorppError as error:
            return RequestError("failed", f"{request.type}: {error}", request.id).reply()
        return {"id": request.id, **reply}

    def _reset(self) -> None:
        self._robot = robot = self._find_robot()
        self._streams = {
            name: StreamingClassifier.from_trained(trained) for name, trained in robot.classifiers.items()
        }
        self._samples: dict[str, list[tuple[float, ...]]] = {name: [] for name in self._streams}
        self._facts: dict[str, str] = {}
        self._labels: dict[str, str] = {}
        self._steps: list[Step] = []
        self._episode: Episode | None = None  # from `decide` on, its steps are those so far
        self._belief: Belief | None = None
        self._report: SharedValue | None = None
        self._is_done = False
        self._is_judged = False

    def _hello(self) -> Json:
        return {"type": "domain", **describe_domain(self._find_robot(), learns=self._keep is not None)}

    def _start(self) -> Json:
        self._reset()
        return {"type": "started"}

    def _observe(self, facts: Mapping[str, str], labels: Mapping[str, str]) -> Json:
        self._require(self._episode is None, "the robot is already deciding; expected `start`")
        classes = self._read_labels(labels)
        reply, _ = self._infer(facts, classes)
        self._facts, self._labels = dict(facts), classes
        return {"type": "posterior", **reply}

    def _read_labels(self, labels: Mapping[str, str]) -> dict[str, str]:
        """Return sense -> class for the labels of senses without a classifier of tracks."""
        senses = {sense.name: sense for sense in self._robot.domain.senses if sense.name not in self._streams}
        classes = {}
        for name, label in labels.items():
            if name not in senses:
                raise RequestError("invalid", f"labels: {name!r}; {expected_one_of(senses)}")
            class_of = {own: value for value, own in senses[name].label_of.items()}
            if label not in class_of:
                raise RequestError("invalid", f"labels: {name} {label!r}; {expected_one_of(class_of)}")
            classes[name] = class_of[label]
        return classes

    def _infer(self, facts: Mapping[str, str], labels: Mapping[str, str]) -> tuple[Json, Episode]:
        """Return what follows from facts and labels, with those of the tracks so far, and the decision."""
        robot, classes = self._robot, {**self._classify(), **labels}
        try:
            evidence, marginal, prior = infer_prior(robot.robot, facts, classes)
            inference = robot.knowledge.infer({name: str(value) for name, value in evidence.items()})
        except (DomainError, UndefinedError) as error:
            raise RequestError("invalid", str(error)) from None
        reply = {
            "evidence": dict(evidence),
            **inference.content,
            "belief": list_belief(robot.domain, prior),
            "fan": draw_fan(robot.domain, robot.parts.policy, prior),
        }
        return reply, Episode(classes, evidence, marginal, prior, (), None, {})

    def _classify(self) -> dict[str, str]:
        """Return sense -> class of the tracks that are long enough."""
        classes = {}
        for name, streams in self._streams.items():
            prediction = streams.predictions.get(PERSON)
            if prediction is not None and prediction.probabilities is not None:
                classes[name] = streams.classifier(PERSON).classify(np.zeros(1))
        return classes

    def _add_samples(self, sense: str, samples: list[tuple[float, ...]]) -> Json:
        self._require(self._episode is None, "the robot is already deciding; expected `start`")
        if sense not in self._streams:
            raise RequestError("invalid", f"sense: {sense!r}; {expected_one_of(self._streams)} with tracks")
        streams = self._streams[sense]
        if len(self._samples[sense]) + len(samples) > MAX_TRACK:
            raise RequestError("too_large", f"expected at most {MAX_TRACK} of them in a trial")
        for sample in samples:
            if len(sample) != 1 + len(streams.inputs):
                raise RequestError(
                    "invalid", f"samples: {len(sample)} numbers; expected time, {', '.join(streams.inputs)}"
                )
        try:
            prediction = streams.push_many((time, PERSON, *values) for time, *values in samples)[PERSON]
        except DataError as error:
            raise RequestError("invalid", str(error)) from None
        self._samples[sense] += samples
        probabilities = prediction.probabilities
        return {
            "type": "prediction",
            "sense": sense,
            "points": prediction.points,
            "track": prediction.track,
            "probabilities": None if probabilities is None else probabilities.tolist(),
            "label": None if probabilities is None else self._find_label(sense),
        }

    def _find_label(self, sense: str) -> str:
        return self._robot.domain.find_sense(sense).label_of[self._classify()[sense]]

    def _decide(self) -> Json:
        self._require(self._episode is None, "the robot is already deciding; expected `answer` or `start`")
        reply, self._episode = self._infer(self._facts, self._labels)
        return {"type": "decision", **reply, **self._act(self._episode.prior)}

    def _act(self, belief: Belief) -> Json:
        """Return the view of a belief; a report is executed at once."""
        robot = self._robot
        self._belief, view = belief, view_belief(robot.domain, robot.parts.policy, belief)
        self._is_done = view["done"]
        if view["report"] is not None:
            self._steps.append(Step(view["action"], None, belief))
            self._report = robot.domain.reported_value(view["action"])
        if self._is_done and self._log is not None:
            self._log(self._format())
        return view

    def _answer(self, said: str, draw: float) -> Json:
        self._require(self._belief is not None, "the robot has not asked; expected `decide` before")
        self._require(not self._is_done, "the decision has ended; expected `start`")
        assert self._belief is not None
        if len(self._steps) >= MAX_STEPS:
            raise RequestError("failed", f"no report after {MAX_STEPS} actions")
        robot, domain = self._robot.robot, self._robot.domain
        action = robot.planner.action(self._belief)
        rows = list_hearing(domain, action)
        if said not in rows:
            raise RequestError("invalid", f"said: {said!r}; {expected_one_of(rows)}")
        heard = domain.pomdp.observations[draw_index(rows[said], draw)]
        try:
            belief = robot.planner.update(self._belief, action, heard)
        except ObservationError as error:
            raise RequestError("invalid", str(error)) from None
        self._steps.append(Step(action, heard, belief))
        return {"type": "step", "said": said, "heard": heard, "answered": action, **self._act(belief)}

    def _judge(self, right: bool, truth: tuple[str, ...] | None) -> Json:
        self._require(self._report is not None, "the robot has not reported; expected `judge` after it")
        self._require(not self._is_judged, "this trial is already judged; expected `start`")
        domain = self._robot.domain
        known = {tuple(domain.reasoning.split(value).values()): value for value in domain.values}
        if right == (truth is not None):
            raise RequestError("invalid", "truth: expected the true value if the robot was wrong, else null")
        if truth is not None and truth not in known:
            raise RequestError(
                "invalid", f"truth: {', '.join(truth)}; {expected_one_of(list(map(', '.join, known)))}"
            )
        value = self._report if truth is None else known[truth]
        if truth is not None and value == self._report:
            raise RequestError(
                "invalid", f"truth: {', '.join(truth)} is what the robot reported; expected another value"
            )
        kept: Mapping[str, Any] = {"stored": 0, "batch": 0}
        if self._keep is not None:
            assert value is not None
            kept = self._keep(JudgedTrial(self._facts, self._samples, value))
        self._is_judged = True
        return {"type": "judged", "learns": self._keep is not None, **kept}

    def _record(self) -> Json:
        self._require(self._episode is not None, "there is no decision; expected `decide` before")
        return {"type": "recorded", "line": json.loads(self._format())}

    def _format(self) -> bytes:
        """Return the decision so far as a line of the decision log."""
        return format_decision(self._robot.parts, LCORPP, self._facts, self._finish())

    def _finish(self) -> Episode:
        """Return the decision so far."""
        assert self._episode is not None
        return replace(self._episode, steps=tuple(self._steps), report=self._report)

    def _require(self, condition: bool, message: str) -> None:
        if not condition:
            raise RequestError("out_of_order", message)


def draw_index(probabilities: list[float], draw: float) -> int:
    """Return the first index whose cumulative probability exceeds a draw from 0 to below 1."""
    total = 0.0
    for i, p in enumerate(probabilities):
        total += p
        if draw < total:
            return i
    return max(i for i, p in enumerate(probabilities) if p > 0)  # the sum is below the draw by rounding
