"""Your own domain is a folder: `drinks`, next to this file, contains three files and no Python.

The same from the command line: `lcorpp run examples/drinks`; `lcorpp check examples/drinks` finds mistakes.
"""

from pathlib import Path

from lcorpp import STRATEGIES, Planner, Reasoner, Robot, load_domain, solve
from lcorpp.scoring import evaluate_exactly
from lcorpp.simulation import NoisyChannel

domain = load_domain(Path(__file__).parent / "drinks")
reasoner = Reasoner(domain.program)

print(f"{domain.description} It is morning, and the guest looks at the kettle.")
for value, probability in reasoner.posterior("wish", {"daytime": "morning", "gaze": "at_kettle"}):
    print(f"  {value:<7} {probability:.3f}")

# Exact scores of the six strategies: all guests and all answers are enumerated.
channels = {"gaze": NoisyChannel.from_domain(domain, domain.senses[0])}
planner = Planner(solve(domain.pomdp, domain.start_beliefs()))
robot = Robot(channels, reasoner, planner, domain)
for scores in evaluate_exactly(domain, robot, channels, STRATEGIES):
    accuracy, return_ = scores.accuracy.estimate, scores.return_.estimate
    print(f"  {scores.strategy:<7} accuracy {accuracy:.3f}  return {return_:6.2f}")
