"""`lcorpp learn`: Algorithm 1, the robot that retrains itself from what it asked."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lcorpp.cli import console as show

if TYPE_CHECKING:
    from lcorpp.experiments.run_store import RunStore
    from lcorpp.protocols import Classifier
    from lcorpp.values import ConfusionMatrix, Dataset, Episode, Instance


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
    learner: show.LearnerOption = None,
    evidence: show.EvidenceOption = show.Evidence.hard,
    epochs: show.EpochsOption = None,
    device: show.DeviceOption = "cpu",
    store: Annotated[
        Path | None,
        typer.Option(
            "--store",
            metavar="FILE",
            help="Keep every decision in this file, by custom *.tracks; there, the next run goes on.",
        ),
    ] = None,
    out: show.OutOption = None,
    jobs: show.JobsOption = None,
) -> None:
    """Run Algorithm 1: decide, store the reported label, retrain each batch, until the classifier settles.

    Every batch is written when it is done; Ctrl-C keeps those. With --store every decision is kept, too, and
    after an interruption of any kind the same command goes on where it was.
    """
    from lcorpp.cli import preparation
    from lcorpp.decision import lcorpp
    from lcorpp.domains import load_domain
    from lcorpp.experiments import active_learning as augmentation
    from lcorpp.experiments.run_store import RunStore
    from lcorpp.experiments.training_data import (
        FOLDS,
        make_estimator,
        read_training_data,
        simulate_training_data,
    )
    from lcorpp.files import make_folder
    from lcorpp.learning import train_and_validate
    from lcorpp.reasoning import Reasoner

    loaded = load_domain(domain, preset=preset)
    preparation.introduce(loaded)
    if out is not None:
        make_folder(out)
    training = (
        read_training_data(loaded, data, seed)
        if data
        else simulate_training_data(loaded, seed, tracks=tracks)
    )
    for note in training.dataset.notes:
        show.console.print(f"note: {note}", style="yellow", markup=False)
    name = learner or (loaded.learning.classifier if loaded.learning.classifier != "channel" else "lstm")
    estimator = make_estimator(training, name, epochs=epochs, seed=seed, device=device)
    soft = evidence is show.Evidence.soft

    def learned(dataset: Dataset) -> tuple[Classifier, ConfusionMatrix]:
        with show.progress(f"training on {len(dataset)} tracks") as advance:
            trained, validation = train_and_validate(
                estimator, dataset, folds=FOLDS, seed=seed, jobs=show.cores(jobs), progress=advance
            )
        return (trained.soft() if soft else trained), validation.confusion

    def reasoner(confusion: ConfusionMatrix) -> Reasoner:
        return Reasoner(loaded.soft_program if soft else loaded.program_for(confusion))

    with ExitStack() as opened:
        run_store, resumed = None, None
        if store is not None:
            settings = {
                "domain": loaded.name,
                "preset": loaded.preset,
                "learner": name,
                "evidence": evidence.value,
                "seed": seed,
                "epochs": epochs,
            }
            run_store = opened.enter_context(RunStore(store, training.dataset, loaded.values, settings))
            resumed = run_store.resume(learned)
            _introduce(run_store)
        crowd = augmentation.PeopleStream(
            loaded, training.trajectories, seed, met=run_store.n_people if run_store else 0
        )
        before = (
            [augmentation.DecisionResult.from_stored(decision) for decision in run_store.pending]
            if run_store
            else []
        )
        log = augmentation.Log(loaded, out, run_store.rows if run_store else [], [o for o in before if o])

        def decided(instance: Instance, episode: Episode) -> None:
            outcome = crowd.outcome(episode)
            log.decided(outcome)
            if run_store is not None:
                belief = loaded.marginal(episode.steps[-1].belief if episode.steps else episode.prior)
                run_store.append_decision(instance, episode, belief, outcome.to_extra())

        batches = lcorpp(
            run_store.dataset() if run_store else training.dataset,
            learn=learned,
            reason=reasoner,
            planner=preparation.planner(loaded),
            domain=loaded,
            collect=crowd.next,
            batch_size=batch_size,
            epsilon=epsilon,
            listener=decided,
            resume_point=resumed,
        )
        try:
            for position, batch in enumerate(batches):
                if resumed is not None and position == 0:
                    show.console.print(f"now {log.standing(batch)}")
                    log.write(batch)
                else:
                    show.console.print(log.add(batch))
                if run_store is not None:
                    run_store.save_checkpoint(batch, log.rows)
                if batch.settled:
                    show.console.print(
                        f"settled: the confusion matrix changed by {batch.change:.3f}, at most {epsilon:g}"
                    )
                elif batch.number >= max_batches:
                    show.console.print(f"stopped after {batch.number} batches; it has not settled yet")
                    break
        except KeyboardInterrupt:
            kept = "the batches above are kept" if log.rows else "no batch was completed"
            kept += "" if store is None else f"; every decision is kept in {store}"
            show.messages.print(f"interrupted: {kept}", markup=False)
    if log.unsaved is not None:
        show.console.print(f"note: the classifier is not saved: {log.unsaved}", style="yellow", markup=False)
    if log.written:
        show.console.print(f"wrote {', '.join(str(path) for path in log.written)}", markup=False)


def _introduce(run_store: RunStore) -> None:
    """Say what is in the store, where the run goes on, and what was lost."""
    path = run_store.store.path
    show.console.print(f"{path}: {run_store.store.snapshot().summary()}", markup=False)
    for note in run_store.notes:
        show.console.print(f"note: {note}", style="yellow", markup=False)
    if run_store.number is not None:
        made = f", {len(run_store.pending)} decisions of the next are made" if run_store.pending else ""
        show.console.print(f"goes on after batch {run_store.number}{made}")
