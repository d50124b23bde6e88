"""The static description of a domain for the page: names, priors, questions and answers."""

from __future__ import annotations

from typing import Any

from lcorpp.domains import Domain, Sense
from lcorpp.learning import StreamingClassifier
from lcorpp.learning.contract import name_of
from lcorpp.web.robot import PlayRobot


def describe_domain(robot: PlayRobot, *, learns: bool) -> dict[str, Any]:
    """Return what the page shows of a domain.

    Args:
        learns: whether the classifier is trained again.
    """
    domain, pomdp = robot.domain, robot.domain.pomdp
    prior = robot.knowledge.infer({})
    roles = dict.fromkeys(domain.reasoning.shared, "shared")
    roles |= dict.fromkeys(domain.observed, "fact") | dict.fromkeys(domain.label_attributes, "label")
    questions = [action for action in pomdp.actions if action not in domain.planning.reports]
    return {
        "name": domain.name,
        "preset": domain.preset,
        "description": domain.description,
        "facts": [
            {"name": name, "values": list(values)}
            for name, values in domain.reasoning.observed_values.items()
        ],
        "senses": [_describe_sense(sense, robot) for sense in domain.senses],
        "attributes": [
            {
                "name": name,
                "values": list(robot.program.attributes[name].values),
                "role": roles.get(name, "hidden"),
                "prior": prior.marginals[name],
            }
            for name in robot.knowledge.attributes
        ],
        "shared": list(domain.reasoning.shared),
        "values": [list(domain.reasoning.split(value).values()) for value in domain.values],
        "actions": [{"name": action, "report": _find_report(domain, action)} for action in pomdp.actions],
        "observations": list(pomdp.observations),
        "phrases": dict(domain.planning.phrases),
        "answers": {action: list_answers(domain, action) for action in questions},
        "noise": {action: list_hearing(domain, action) for action in questions},
        "noisy": bool((domain.simulation.hearing.diagonal(axis1=1, axis2=2) < 1).any()),
        "learns": learns,
        "positive": domain.positive,
    }


def list_answers(domain: Domain, action: str) -> list[str]:
    """Return the observations that an action may lead to, in some state."""
    pomdp = domain.pomdp
    rows = pomdp.observation.dense[pomdp.action_index(action)]
    possible = rows[domain.planning.state_values.any(axis=1)].max(axis=0) > 0
    return [name for name, is_possible in zip(pomdp.observations, possible, strict=True) if is_possible]


def list_hearing(domain: Domain, action: str) -> dict[str, list[float]]:
    """Return the observation that a person gives -> the probability of each observation heard."""
    rows = domain.simulation.hearing[domain.pomdp.action_index(action)].tolist()
    return dict(zip(domain.pomdp.observations, rows, strict=True))


def _find_report(domain: Domain, action: str) -> list[str] | None:
    value = domain.reported_value(action)
    return None if value is None else list(domain.reasoning.split(value).values())


def _describe_sense(sense: Sense, robot: PlayRobot) -> dict[str, Any]:
    trained = robot.classifiers.get(sense.name)
    content: dict[str, Any] = {
        "name": sense.name,
        "attribute": sense.attribute,
        "of": sense.of,
        "labels": [{"label": label, "class": name} for name, label in sense.label_of.items()],
        "kind": "choice" if trained is None else "track",
    }
    if trained is None:
        return content
    streams = StreamingClassifier.from_trained(trained)
    rules = streams.rules
    return content | {
        "inputs": list(streams.inputs),
        "classes": list(streams.classes),
        "rate": rules.rate,
        "min_points": streams.min_points,
        "max_gap": rules.max_gap,
        "max_duration": rules.max_duration,
        "classifier": name_of(trained.estimator),
    }
