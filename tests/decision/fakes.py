"""Fake parts of ten lines each: both algorithms run on them without torch, clingo or a robot."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from lcorpp.values import Array, Belief, Distribution, Instance, Label, Likelihood

VALUES = ("yes", "no")


class FakeDomain:
    """Two states, one for each value; facts and labels keep their names."""

    shared = "wish"
    values = VALUES
    label_attributes = shared_label_attributes = ("label",)

    def evidence(self, context: Mapping[str, str], labels: Mapping[str, Label]) -> dict[str, Label]:
        return {**context, **({"label": labels["eyes"]} if "eyes" in labels else {})}

    def label_marginal(self, evidence: Mapping[str, Label]) -> Distribution | None:
        label = evidence.get("label")
        if isinstance(label, Likelihood):
            return Distribution(label.values, label.weights / label.weights.sum())
        return None if label is None else Distribution.certain(label, VALUES)

    def class_of(self, sense: str, value: str) -> str:
        return value

    def prior(self, marginal: Distribution) -> Belief:
        return marginal.probabilities

    def marginal(self, belief: Belief) -> Distribution:
        return Distribution(VALUES, belief)

    def reported_value(self, action: str) -> str | None:
        return action.removeprefix("say ") if action.startswith("say ") else None

    def report_action(self, value: str) -> str:
        return f"say {value}"

    def is_terminal(self, belief: Belief) -> bool:
        return False


class FakeClassifier:
    """Returns the value whose index is the first number of the trajectory."""

    def classify(self, signal: Array) -> str | None:
        return VALUES[int(signal[0, 0])]


class FakeReasoner:
    """P(yes) is .8 given the label yes, .2 given no, else .6 under a sunny sky; records its queries."""

    def __init__(self) -> None:
        self.queries: list[tuple[str, dict[str, str]]] = []

    def posterior(self, attribute: str, evidence: Mapping[str, str]) -> Distribution | None:
        self.queries.append((attribute, dict(evidence)))
        p = 0.6 if evidence.get("sky") == "sunny" else 0.5
        if "label" in evidence:
            p = 0.8 if evidence["label"] == "yes" else 0.2
        return Distribution(VALUES, np.array([p, 1 - p]))


class FakePlanner:
    """Asks until one value has probability .9; an answer is correct with probability .75."""

    start = np.array([0.5, 0.5])

    def action(self, belief: Belief) -> str:
        best = int(np.argmax(belief))
        return f"say {VALUES[best]}" if belief[best] >= 0.9 else "ask"

    def update(self, belief: Belief, action: str, observation: str) -> Belief:
        after = belief * (np.array([0.75, 0.25]) if observation == "nod" else np.array([0.25, 0.75]))
        return after / after.sum()


class FakeWorld:
    """A world that returns given answers in their order and records the actions."""

    def __init__(self, *answers: str) -> None:
        self.answers, self.done = list(answers), list[str]()

    def act(self, action: str) -> str:
        self.done.append(action)
        return self.answers.pop(0)

    def report(self, action: str) -> None:
        self.done.append(action)


def make_instance(index: int, sky: str = "grey") -> Instance:
    """An instance of the value with this index."""
    return Instance({"eyes": np.full((1, 2), float(index))}, {"sky": sky})
