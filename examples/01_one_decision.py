"""One decision, part by part: label, evidence, posterior, prior, actions, report.

Run it with `python examples/01_one_decision.py`; with `--ask` you type the answers.
"""

import sys

import numpy as np

from lcorpp import ConsoleWorld, Instance, Planner, Reasoner, Robot, dt_control, load_domain, solve


class Classifier:
    """Placeholder for your classifier: any object that maps a signal, here a trajectory, to a class."""

    def classify(self, signal: np.ndarray) -> str:
        return "not_interested"


domain = load_domain("intention")
planner = Planner(solve(domain.pomdp, domain.start_beliefs()))
robot = Robot({"motion": Classifier()}, Reasoner(domain.program), planner, domain)

person = Instance({"motion": np.zeros((2, 304))}, {"time": "afternoon", "location": "classroom"})
answer = input if "--ask" in sys.argv else lambda question: "pos"
episode = dt_control(robot, person, ConsoleWorld(domain.pomdp.observations, ask=answer))

print("label:    ", episode.labels["motion"])
print("evidence: ", dict(episode.evidence))
print("posterior:", {value: round(p, 6) for value, p in episode.marginal})
print("prior:    ", np.round(episode.prior, 2))
for step in episode.steps:
    print(f"  {step.action:<22} -> {step.observation or '':<5} {np.round(step.belief, 3)}")
print("report:   ", episode.report)
