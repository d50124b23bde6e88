"""Your own recording: errors with line numbers, repairs on request, a leakage check, and a data set."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from lcorpp.errors import LcorppError
from lcorpp.learning import count_repairs, measure_leakage, read_recording, to_dataset

rng = np.random.default_rng(0)
lines = ["track,time,x,y,label"]
for number in range(60):
    wants = number % 2  # interested people walk more slowly and are always recorded two seconds longer
    for i in range(110 + 20 * wants):
        t, speed = i / 10, 1.2 - 0.3 * wants
        x, y = speed * t + rng.normal(0, 0.02), number / 30 + rng.normal(0, 0.02)
        lines.append(f"{number},{t:.1f},{x:.3f},{y:.3f},{('passes', 'wants')[wants]}")
lines[40] = lines[40].replace(",3.9,", ",,")  # a time is missing
lines.append(lines[-1])  # a row is repeated

with tempfile.TemporaryDirectory() as folder:
    file = Path(folder) / "people.csv"
    file.write_text("\n".join(lines) + "\n")
    try:
        read_recording(file)
    except LcorppError as error:
        print("refused:", str(error).splitlines()[0].removeprefix(f"{folder}/"))
    recording = read_recording(file, repair=["nonfinite", "duplicates"])

for reason, (rows, places) in count_repairs(recording.repairs).items():
    print(f"repaired: {reason}, {rows} rows in {places} places")
for leak in measure_leakage(recording):
    print(f"{leak.name:<13} AUC {leak.auc.estimate:.2f} {'LEAK' if leak.is_suspicious else ''}".rstrip())
data = to_dataset(recording, interval=0.1, points=101)  # the last ten seconds of each track
print(f"a data set of {data.trajectories.shape}: {', '.join(data.channels)} every {data.interval:g} s")
leaks = {leak.name: leak for leak in measure_leakage(data)}
print(f"duration      AUC {leaks['duration'].auc.estimate:.2f}")
