"""Two people walk past the robot while a tracker sends their samples, some late, lost or not a number.

The classifier learns from tracks and from their beginnings, and what it said of people new to it tells how
far to trust it after so many seconds. A sample costs the same after a minute as after a second.
"""

import numpy as np

from lcorpp import Instance, load_domain
from lcorpp.learning import (
    StreamingClassifier,
    calibrate_prefixes,
    cross_predict_over_time,
    paper_pipeline,
    train,
    with_prefix_ensemble,
)
from lcorpp.values import Dataset

RNG = np.random.default_rng(1)
INTERESTED, OTHER = {"intention": "interested"}, {"intention": "not_interested"}

people = [INTERESTED, OTHER] * 200
walkers = load_domain("intention").simulation.trajectories
tracks = Dataset(walkers(people, RNG), tuple(person["intention"] for person in people))
learner = with_prefix_ensemble(paper_pipeline(epochs=30), shares=(0.25, 0.5, 1.0))
timeline = cross_predict_over_time(learner, tracks, folds=3)
print("AUC after a quarter, half, all of the track:", [round(timeline.auc_at(s), 2) for s in (0.25, 0.5, 1)])
trained = train(learner, tracks)
streams = StreamingClassifier.from_trained(
    trained, prefix_calibration=calibrate_prefixes(timeline), allowed_lateness=0.1
)


def tracked(name: str, walk: np.ndarray) -> list[tuple[float, tuple]]:
    """(arrival, sample) as a tracker sends them: 30 a second, with jitter; Bo is hidden for a while."""
    sent = []
    for number, (x, y) in enumerate(walk.T.tolist()):
        time = number * 0.033 + RNG.normal(0, 0.004)
        if RNG.uniform() < 0.1 or (name == "Bo" and 3 < time < 3.6):
            continue
        x = float("nan") if RNG.uniform() < 0.02 else x
        sent.append((time + 0.08 * (RNG.uniform() < 0.05), (time, name, x, y)))
    return sent


walks = dict(zip(("Ada", "Bo"), walkers([INTERESTED, OTHER], RNG), strict=True))
arriving = sorted(one for name, walk in walks.items() for one in tracked(name, walk))

# The decision loop wants a classifier and an instance: this classifier has heard one person's samples so far.
view = Instance(trajectory=np.zeros((2, 2)), context={"time": "afternoon", "location": "classroom"})
second = 1
for arrival, sample in arriving:
    streams.push(*sample)
    if arrival >= second:
        speaks_for = {name: streams.classifier(name).soft().classify(view) for name in walks}
        print(
            f"{second:2} s: likelihood of interested to not interested:",
            *(f"{name} {seen.weights[0] / seen.weights[1]:.2f} " for name, seen in speaks_for.items()),
        )
        second += 1
print(streams.report())

# When all is heard, the answer is what the pipeline says of all samples at once.
for name in walks:
    heard = {time: (x, y) for _, (time, who, x, y) in arriving if who == name and x == x}
    times = sorted(heard)
    motion, *_ = steps = trained.estimator
    batch = steps[1:].predict_proba(motion.transform_stamped(times, np.array([heard[t] for t in times]).T))[0]
    print(f"{name}: as the batch to 1e-6:", np.abs(streams.remove(name).probabilities - batch).max() < 1e-6)
