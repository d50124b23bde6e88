"""A domain of your own is a folder: `drinks`, beside this file, has three files and no Python.

The same as a command: `lcorpp run examples/drinks`, and `lcorpp check examples/drinks` while you write yours.
"""

from pathlib import Path

from lcorpp import STRATEGIES, Planner, Reasoner, Robot, load_domain, solve
from lcorpp.experiments.exact_evaluation import evaluate_exactly
from lcorpp.simulation.channel import NoisyChannel

domain = load_domain(Path(__file__).parent / "drinks")
reasoner = Reasoner(domain.program)

print(f"{domain.description} It is morning, and the guest looks at the kettle.")
for value, probability in reasoner.posterior("wish", {"daytime": "morning", "gaze": "at_kettle"}):
    print(f"  {value:<7} {probability:.3f}")

# The six strategies, scored exactly: every guest and every answer enumerated.
channel = NoisyChannel.of(domain)
planner = Planner(solve(domain.pomdp, domain.start_beliefs()))
robot = Robot(channel, reasoner, planner, domain)
for scores in evaluate_exactly(domain, robot, channel, STRATEGIES):
    accuracy, return_ = scores.accuracy.estimate, scores.return_.estimate
    print(f"  {scores.strategy:<7} accuracy {accuracy:.3f}  return {return_:6.2f}")
