"""The model that the engine in the page reads: a robot as one JSON object."""

from __future__ import annotations

import base64
import json
from collections.abc import Mapping
from itertools import product
from math import isfinite, prod
from typing import Any

import numpy as np

from lcorpp.assembly.estimators import make_untrained
from lcorpp.assembly.options import ClassifierOptions, StoredOptions
from lcorpp.assembly.robot_parts import describe_strategy
from lcorpp.assembly.track_robot import LEARNER, POSITION
from lcorpp.domains import Domain
from lcorpp.errors import DataError, TooLargeError, UndefinedError
from lcorpp.learning import (
    ChannelStandardizer,
    LstmClassifier,
    Motion,
    StreamingClassifier,
    TrainedClassifier,
    load_classifier,
)
from lcorpp.learning.contract import name_of
from lcorpp.logs.decision_log import FORMAT as LOG_FORMAT
from lcorpp.planning import AlphaVectors, Policy
from lcorpp.planning.sparse import SparseTables
from lcorpp.values import Array
from lcorpp.versioned_json import JsonFormat
from lcorpp.web.description import describe_domain
from lcorpp.web.limits import describe_plan
from lcorpp.web.reachable import prune_policy
from lcorpp.web.robot import PlayRobot

FORMAT = JsonFormat("lcorpp page", 1)
MAX_EVIDENCES = 20_000
"""Combinations of facts and labels, each of them known or unknown, whose posteriors an exported page has."""
MAX_NUMBERS = 50_000
"""Numbers in alpha vectors; of a larger policy an exported page has only the vectors that decisions use."""
DIGITS = 12
"""Decimal digits of what is only shown."""


def make_model(robot: PlayRobot, *, learns: bool) -> dict[str, Any]:
    """Return the model for a page with a server, which infers, and runs the classifiers that the page cannot.

    Args:
        learns: whether the classifier is trained again.
    """
    classifiers = {name: own for name, own in robot.classifiers.items() if find_steps(own.estimator)}
    return _describe(robot, robot.parts.alpha_policy, classifiers, learns=learns)


def make_exported_model(robot: PlayRobot) -> dict[str, Any]:
    """Return the model for a page without a server: also with the posteriors of all evidence.

    Raises:
        TooLargeError: the evidence has more than `MAX_EVIDENCES` combinations.
        DataError: a classifier is not an LSTM of the motion.
    """
    domain, policy = robot.domain, robot.parts.alpha_policy
    check_evidence(domain)
    for trained in robot.classifiers.values():
        require_steps(trained.estimator)
    posteriors, rules = tabulate_posteriors(robot)
    if sum(part.vectors.size for part in policy.vector_sets) > MAX_NUMBERS:
        priors = np.array([domain.planning.initial_states.T @ own["shared"] for own in posteriors.values()])
        policy = prune_policy(domain, policy, priors)
    model = _describe(robot, policy, robot.classifiers, learns=False)
    return {**model, "posteriors": posteriors, "rules": rules}


def _describe(
    robot: PlayRobot, policy: Policy, classifiers: Mapping[str, TrainedClassifier], *, learns: bool
) -> dict[str, Any]:
    domain, plan = robot.domain, robot.plan
    return {
        **FORMAT.header,
        "domain": describe_domain(robot, learns=learns)
        | ({} if plan is None else {"limits": [limit.name for limit in domain.planning.limits]}),
        "planner": _describe_planner(robot, policy),
        "limits": None if plan is None else describe_plan(plan),
        "classifiers": {name: describe_classifier(own) for name, own in classifiers.items()},
        "log": {
            "head": {
                **LOG_FORMAT.header,
                "domain": domain.name,
                "preset": domain.preset,
                "strategy": describe_strategy(robot.strategy),
            },
            "parts": robot.parts.description,
        },
    }


def check_evidence(domain: Domain) -> None:
    """Raise `TooLargeError` if the evidence has more than `MAX_EVIDENCES` combinations."""
    count = prod(len(values) + 1 for values in _list_evidence(domain).values())
    if count > MAX_EVIDENCES:
        raise TooLargeError(
            f"{domain.name}: {count} combinations of facts and labels; expected at most {MAX_EVIDENCES}, as"
            " the page stores the posteriors of each"
        )


def check_classifiers(classifiers: Mapping[str, ClassifierOptions]) -> None:
    """Check before the training that an exported page can run the classifiers.

    Raises:
        DataError: one is not an LSTM of the motion of positions, or a learner or file is wrong.
        FileError: a file cannot be read.
    """
    for options in classifiers.values():
        if isinstance(options, StoredOptions):
            require_steps(load_classifier(options.file).estimator)
        elif options is not None:
            require_steps(make_untrained(options))


def _list_evidence(domain: Domain) -> dict[str, tuple[str, ...]]:
    """Return attribute -> values, of the facts and then of the labels."""
    labels = {sense.attribute: tuple(sense.label_of.values()) for sense in domain.senses}
    return {**domain.reasoning.observed_values, **labels}


def tabulate_posteriors(robot: PlayRobot) -> tuple[dict[str, dict[str, Any]], list[dict[str, Any]]]:
    """Return what follows from each possible evidence, and the rules that fire in any of them.

    A key is the values of the facts and labels, "" if unknown, joined by "|"; impossible evidence is absent.
    """
    values_of = _list_evidence(robot.domain)
    posteriors, numbers = dict[str, dict[str, Any]](), dict[str, int]()
    for values in product(*[("", *values) for values in values_of.values()]):
        evidence = {name: value for name, value in zip(values_of, values, strict=True) if value}
        try:
            inference = robot.knowledge.infer(evidence)
        except UndefinedError:
            continue
        fired = [numbers.setdefault(json.dumps(rule), len(numbers)) for rule in inference.fired]
        marginals = inference.marginals.values()
        posteriors["|".join(values)] = {
            "marginals": [None if row is None else [round(p, DIGITS) for p in row] for row in marginals],
            "shared": inference.shared.probabilities.tolist(),
            "fired": fired,
            "world": [inference.world.get(name) for name in inference.marginals],
            "world_probability": round(inference.world_probability, DIGITS),
        }
    return posteriors, [json.loads(rule) for rule in numbers]


def _describe_planner(robot: PlayRobot, policy: Policy) -> dict[str, Any]:
    domain, pomdp = robot.domain, robot.domain.pomdp
    values = domain.planning.state_values
    return {
        "states": list(pomdp.states),
        "discount": pomdp.discount,
        "terminal": list(domain.planning.terminal),
        "initial_states": domain.planning.initial_states.tolist(),
        "value_of": [int(row.argmax()) if row.any() else -1 for row in values],
        "T": _list_entries(pomdp.actions, pomdp.transition),
        "O": _list_entries(pomdp.actions, pomdp.observation),
        "R": dict(zip(pomdp.actions, pomdp.reward.tolist(), strict=True)),
        "sets": [_describe_vectors(part) for part in policy.vector_sets],
        "floor": policy.floor if isfinite(policy.floor) else None,  # a policy for all states needs none
    }


def _describe_vectors(part: AlphaVectors) -> dict[str, Any]:
    """Return vectors as whole numbers of a quantum, a billionth of the largest number: half of the bytes."""
    quantum = float(np.abs(part.vectors).max()) / 2**30 or 1.0
    return {
        "states": part.states.tolist(),
        "actions": part.actions.tolist(),
        "quantum": quantum,
        "vectors": _encode(np.rint(part.vectors / quantum), "<i4"),
    }


def _list_entries(actions: tuple[str, ...], tables: SparseTables) -> dict[str, list[list[float]]]:
    """Return action -> [row, column, value] of each entry that is not 0."""
    entries = {}
    for a, action in enumerate(actions):
        table = tables[a]
        rows, columns = np.nonzero(table)
        numbers = zip(rows.tolist(), columns.tolist(), table[rows, columns].tolist(), strict=True)
        entries[action] = [list(own) for own in numbers]
    return entries


def find_steps(estimator: Any) -> tuple[Motion, ChannelStandardizer, LstmClassifier] | None:
    """Return the steps of an LSTM of the motion of positions, fitted or not; None for another classifier."""
    steps = [step for _, step in getattr(estimator, "steps", [])]
    kinds = (Motion, ChannelStandardizer, LstmClassifier)
    is_known = len(steps) == len(kinds) and all(map(isinstance, steps, kinds))
    return (steps[0], steps[1], steps[2]) if is_known and tuple(steps[0].inputs) == POSITION else None


def require_steps(estimator: Any) -> tuple[Motion, ChannelStandardizer, LstmClassifier]:
    """Return `find_steps`.

    Raises:
        DataError: there are none.
    """
    steps = find_steps(estimator)
    if steps is None:
        raise DataError(
            f"the exported page cannot run {name_of(estimator)}; expected an LSTM of the motion of positions,"
            f" e.g. --learner {LEARNER}"
        )
    return steps


def describe_classifier(trained: TrainedClassifier) -> dict[str, Any]:
    """Return a classifier that the page can run; raises as `require_steps`."""
    motion, standardizer, network = require_steps(trained.estimator)
    streams = StreamingClassifier.from_trained(trained)
    rules, weights = streams.rules, network.weights_
    threshold = trained.threshold
    return {
        "classes": list(trained.classes),
        "threshold": None
        if threshold is None
        else {"name": threshold.name, "probability": threshold.probability},
        "rules": {
            "rate": rules.rate,
            "max_gap": rules.max_gap,
            "max_duration": rules.max_duration,
            "max_speed": rules.max_speed,
            "min_points": streams.min_points,
        },
        "motion": {
            "features": list(motion.features),
            "rate": motion.rate,
            "robot": list(map(float, motion.robot)),
        },
        "mean": standardizer.mean_.tolist(),
        "scale": standardizer.scale_.tolist(),
        "units": weights.units,
        "weights": {name: _encode(own, "<f4") for name, own in weights.arrays().items()},
    }


def _encode(array: Array | Any, kind: str) -> str:
    """Return the numbers of an array as base64, little-endian."""
    return base64.b64encode(np.ascontiguousarray(array, dtype=kind).tobytes()).decode()


def write_model(model: Mapping[str, Any]) -> str:
    """Return the model as compact JSON that a script element may contain."""
    text = json.dumps(model, ensure_ascii=True, separators=(",", ":"), allow_nan=False)
    return text.replace("<", "\\u003c")  # no "</script>", no "<!--"
