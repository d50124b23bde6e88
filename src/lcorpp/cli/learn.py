"""`lcorpp learn`: Algorithm 1, the robot that retrains itself from what it asked."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from lcorpp.cli import show


def learn(
    domain: show.DomainArgument = "intention",
    preset: show.PresetOption = None,
    batch_size: Annotated[
        int, typer.Option("--batch-size", min=1, help="K: decisions between trainings.")
    ] = 100,
    epsilon: Annotated[
        float,
        typer.Option("--epsilon", min=0, help="Stop when the confusion matrix changes by at most this."),
    ] = 0.05,
    max_batches: Annotated[
        int, typer.Option("--max-batches", min=1, help="Stop after this many batches.")
    ] = 20,
    tracks: show.TracksOption = 100,
    seed: show.SeedOption = 0,
    data: show.DataOption = None,
    epochs: show.EpochsOption = None,
    out: show.OutOption = None,
    jobs: show.JobsOption = None,
) -> None:
    """Run Algorithm 1: decide, store the reported label, retrain each batch, until the classifier settles.

    Every batch is written when it is done; Ctrl-C keeps those.
    """
    from lcorpp.cli import preparation
    from lcorpp.decision import lcorpp
    from lcorpp.domains import load_domain
    from lcorpp.experiments import augmentation
    from lcorpp.experiments.training import learn as train
    from lcorpp.experiments.training import recorded_training, simulated_training
    from lcorpp.files import make_folder
    from lcorpp.values import Dataset

    loaded = load_domain(domain, preset=preset)
    preparation.introduce(loaded)
    if out is not None:
        make_folder(out)
    training = (
        recorded_training(loaded, data, seed) if data else simulated_training(loaded, seed, tracks=tracks)
    )
    for note in training.dataset.notes:
        show.console.print(f"note: {note}", style="yellow")
    crowd = augmentation.Crowd(loaded, training.appearance, seed)
    log = augmentation.Log(loaded, out)

    def learned(dataset: Dataset) -> Any:
        with show.progress(f"training on {len(dataset)} tracks") as advance:
            trained, validation = train(
                dataset, epochs=epochs or training.epochs, seed=seed, jobs=show.cores(jobs), progress=advance
            )
        return trained, validation.confusion

    batches = lcorpp(
        training.dataset,
        learn=learned,
        reason=loaded.program_for,
        planner=preparation.planner(loaded),
        domain=loaded,
        collect=crowd.next,
        batch_size=batch_size,
        epsilon=epsilon,
    )
    try:
        for batch in batches:
            show.console.print(log.add(batch, crowd.met()))
            if batch.settled:
                show.console.print(
                    f"settled: the confusion matrix changed by {batch.change:.3f}, at most {epsilon:g}"
                )
            elif batch.number == max_batches:
                show.console.print(f"stopped after {max_batches} batches; it has not settled yet")
                break
    except KeyboardInterrupt:
        show.messages.print("interrupted: the batches above are kept")
    if out is not None:
        show.console.print(f"wrote {', '.join(str(path) for path in log.written)}")
