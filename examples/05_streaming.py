"""Classify two people while a tracker sends their samples, some of them late, lost or not a number.

The classifier is trained on tracks and on prefixes of tracks, and calibrated out-of-fold for each prefix
length. The cost of a sample does not depend on the length of the track.
"""

import numpy as np

from lcorpp import load_domain
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
walkers = load_domain("intention").simulation.signals["motion"]
tracks = Dataset(walkers(people, RNG), tuple(person["intention"] for person in people))
learner = with_prefix_ensemble(paper_pipeline(epochs=30), fractions=(0.25, 0.5, 1.0))
timeline = cross_predict_over_time(learner, tracks, folds=3)
print("AUC after a quarter, half, all of the track:", [round(timeline.auc_at(s), 2) for s in (0.25, 0.5, 1)])
trained = train(learner, tracks)
streams = StreamingClassifier.from_trained(
    trained, prefix_calibration=calibrate_prefixes(timeline), allowed_lateness=0.1
)


def simulate_tracker(name: str, walk: np.ndarray) -> list[tuple[float, tuple]]:
    """(arrival, sample) pairs of a tracker: 30 per second, with jitter; Bo is occluded for a while."""
    samples = []
    for number, (x, y) in enumerate(walk.T.tolist()):
        time = number * 0.033 + RNG.normal(0, 0.004)
        if RNG.uniform() < 0.1 or (name == "Bo" and 3 < time < 3.6):
            continue
        x = float("nan") if RNG.uniform() < 0.02 else x
        samples.append((time + 0.08 * (RNG.uniform() < 0.05), (time, name, x, y)))
    return samples


walks = dict(zip(("Ada", "Bo"), walkers([INTERESTED, OTHER], RNG), strict=True))
arriving = sorted(one for name, walk in walks.items() for one in simulate_tracker(name, walk))

# The decision loop needs a classifier: this one has a person's samples so far, and reads no other signal.
no_signal = np.zeros((2, 2))
second = 1
for arrival, sample in arriving:
    streams.push(*sample)
    if arrival >= second:
        likelihoods = {name: streams.classifier(name).soft().classify(no_signal) for name in walks}
        print(
            f"{second:2} s: likelihood of interested to not interested:",
            *(
                f"{name} {likelihood.weights[0] / likelihood.weights[1]:.2f} "
                for name, likelihood in likelihoods.items()
            ),
        )
        second += 1
print(streams.report())

# After the last sample, the prediction equals that of the pipeline on the whole track.
for name in walks:
    received = {time: (x, y) for _, (time, who, x, y) in arriving if who == name and x == x}
    times = sorted(received)
    motion, *_ = steps = trained.estimator
    positions = np.array([received[t] for t in times]).T
    batch = steps[1:].predict_proba(motion.transform_stamped(times, positions))[0]
    print(f"{name}: as the batch to 1e-6:", np.abs(streams.remove(name).probabilities - batch).max() < 1e-6)
