"""The Keras side of benchmarks/learner.py, in its own process on its own core; independent of lcorpp.

    KERAS_BACKEND=jax python benchmarks/learner_keras.py CASES.npz EPOCHS CORE FOLD...

CASES.npz holds x (cases, time points, channels), y (cases,) 0 or 1 and folds (cases,). For every fold the
paper's network is trained on the cases outside of it; -1 stands for all cases. Prints one line of JSON.
"""

import json
import os
import sys
import time

BEGAN = time.perf_counter()


def main(cases: str, epochs: int, core: int, folds: list[int]) -> None:
    """Train on every fold and print the times."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {core})
    import keras
    import numpy as np

    given = np.load(cases)
    seconds = list[list[tuple[float, float]]]()
    sizes, started = [], time.perf_counter() - BEGAN

    class Watch(keras.callbacks.Callback):  # type: ignore[misc]  # Keras has no stubs
        def on_epoch_begin(self, epoch: int, logs: object = None) -> None:
            self.wall, self.cpu = time.perf_counter(), time.process_time()

        def on_epoch_end(self, epoch: int, logs: object = None) -> None:
            seconds[-1].append((time.perf_counter() - self.wall, time.process_time() - self.cpu))

    for fold in folds:
        seconds.append([])
        rows = given["folds"] != fold
        sizes.append(int(rows.sum()))
        keras.utils.set_random_seed(0)
        network = keras.Sequential(
            [
                keras.layers.Input(given["x"].shape[1:]),
                keras.layers.LSTM(50),
                keras.layers.Dropout(0.2),
                keras.layers.Dense(1, activation="sigmoid"),
            ]
        )
        network.compile(optimizer="adam", loss="binary_crossentropy")
        network.fit(
            given["x"][rows], given["y"][rows], batch_size=32, epochs=epochs, verbose=0, callbacks=[Watch()]
        )
        network.predict(given["x"][~rows] if fold >= 0 else given["x"][:1], verbose=0)
    report = {
        "keras": keras.__version__,
        "started": started,
        "wall": time.perf_counter() - BEGAN,
        "cpu": time.process_time(),
        "sizes": sizes,
        "seconds": seconds,
    }
    print(json.dumps(report))


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]), [int(fold) for fold in sys.argv[4:]])
