"""Decide how long to watch a person: `watch` is an action of the planner, and its cost are seconds.

A classifier of walking people is trained, the stream of its predictions is estimated from people it was not
trained on, and the domain's model is extended by it. Then a person walks by.
"""

from collections.abc import Iterator

import numpy as np

from lcorpp import load_domain
from lcorpp.assembly import solve_domain
from lcorpp.decision import Robot
from lcorpp.decision.dt_control import act_until_report, infer_prior
from lcorpp.early_decision.extension import extend_domain
from lcorpp.early_decision.stream_model import fit_stream_model
from lcorpp.early_decision.stream_world import StreamWorld
from lcorpp.learning import (
    Prediction,
    StreamingClassifier,
    cross_predict_over_time,
    learner,
    train,
    with_prefix_ensemble,
)
from lcorpp.planning import Planner
from lcorpp.reasoning import Reasoner
from lcorpp.simulation import SimulatedWorld, SimulationModel
from lcorpp.values import Dataset

RNG = np.random.default_rng(1)
INTERVAL = 0.033

domain = load_domain("intention")
people = [{"intention": "interested"}, {"intention": "not_interested"}] * 200
walkers = domain.simulation.signals["motion"]
tracks = Dataset(walkers(people, RNG), tuple(person["intention"] for person in people), interval=INTERVAL)
estimator = with_prefix_ensemble(learner("summaries", interval=INTERVAL))
stream = fit_stream_model(cross_predict_over_time(estimator, tracks, folds=3))
print(stream)
classifier = train(estimator, tracks)


def predict(walk: np.ndarray) -> Iterator[Prediction]:
    """Yield the prediction after each sample; a robot's tracker sends them while the person walks."""
    streams = StreamingClassifier.from_trained(classifier)
    for number, (x, y) in enumerate(walk.T.tolist()):
        yield streams.push(number * INTERVAL, "Ada", x, y)


# A student in the classroom in the evening is not a likely visitor: the facts alone say .3.
ada = {"intention": "interested", "time": "evening", "location": "classroom"}
walk = walkers([ada], RNG)[0]
facts = {"time": ada["time"], "location": ada["location"]}
for cost in (0.25, 1.0, 10.0):
    extended = extend_domain(domain, stream, cost=cost)
    robot = Robot({}, Reasoner(domain.program), Planner(solve_domain(extended, any_prior=True)), extended)
    prior = infer_prior(robot, facts, {})[-1]
    answers = SimulatedWorld(SimulationModel(domain), ada, np.random.default_rng(2))
    world = StreamWorld(stream, predict(walk), answers)
    steps, report = act_until_report(robot, prior, world)[:2]
    print(f"\na second costs {cost:g}: watched {world.seconds:.2f} s, report {report}")
    for step in steps:
        belief = extended.marginal(step.belief).probabilities[0]
        print(f"  {step.action:14} {step.observation or '':12} P(interested) = {belief:.2f}")
