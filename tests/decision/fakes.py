"""Ten-line parts: both algorithms run on them without torch, clingo or a robot."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from lcorpp.values import Belief, Distribution, Instance

VALUES = ("yes", "no")


class Words:
    """Two states, one for each value; facts and labels pass through under their own names."""

    target = "wish"
    values = VALUES

    def evidence(self, context: Mapping[str, str], label: str | None) -> dict[str, str]:
        return {**context, **({} if label is None else {"label": label})}

    def target_of_label(self, evidence: Mapping[str, str]) -> str | None:
        return evidence.get("label")

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


class Eyes:
    """Says what the first number of the trajectory stands for."""

    def classify(self, instance: Instance) -> str | None:
        return VALUES[int(instance.trajectory[0, 0])]


class Mind:
    """Believes a label by .8 and a sunny sky by .6; remembers what it was asked."""

    def __init__(self) -> None:
        self.asked: list[tuple[str, dict[str, str]]] = []

    def posterior(self, attribute: str, evidence: Mapping[str, str]) -> Distribution | None:
        self.asked.append((attribute, dict(evidence)))
        p = 0.6 if evidence.get("sky") == "sunny" else 0.5
        if "label" in evidence:
            p = 0.8 if evidence["label"] == "yes" else 0.2
        return Distribution(VALUES, np.array([p, 1 - p]))


class Plan:
    """Asks until one value has .9; an answer is right by .75."""

    start = np.array([0.5, 0.5])

    def action(self, belief: Belief) -> str:
        best = int(np.argmax(belief))
        return f"say {VALUES[best]}" if belief[best] >= 0.9 else "ask"

    def update(self, belief: Belief, action: str, observation: str) -> Belief:
        after = belief * (np.array([0.75, 0.25]) if observation == "nod" else np.array([0.25, 0.75]))
        return after / after.sum()


class Answers:
    """A world that gives the answers it is given, in their order, and remembers what was done."""

    def __init__(self, *answers: str) -> None:
        self.answers, self.done = list(answers), list[str]()

    def act(self, action: str) -> str:
        self.done.append(action)
        return self.answers.pop(0)

    def report(self, action: str) -> None:
        self.done.append(action)


def seen(index: int, sky: str = "grey") -> Instance:
    """An instance whose trajectory stands for the value of that index."""
    return Instance(np.full((1, 2), float(index)), {"sky": sky})
