"""`lcorpp observe`: measure the observation model of speech, on synthetic voices or recordings."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lcorpp.cli import console, output_files
from lcorpp.cli.options import common as options
from lcorpp.cli.options.code import take_consent

if TYPE_CHECKING:
    from lcorpp.hearing.observing import Observed


@take_consent
def observe(
    domain: options.DomainArgument = "intention",
    preset: options.PresetOption = None,
    voices: Annotated[
        str,
        typer.Option(
            help="Synthetic voices, separated by commas: flite:NAME, espeak-ng:NAME, piper:MODEL.onnx, or"
            " wave:FOLDER with a file for each sentence."
        ),
    ] = "flite:slt,flite:rms,flite:awb,flite:kal16",
    noise: Annotated[
        str,
        typer.Option(
            help="The mix of noises: clean, white:SNR and babble:SNR in dB, with equal shares or NOISE@SHARE."
        ),
    ] = "clean,white:20,babble:20",
    recordings: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER",
            help="Recordings instead of voices and noise: a folder for each answer and one for all else, e.g."
            " pos, neg, none; files such as yes_please-ann.wav.",
        ),
    ] = None,
    said: Annotated[
        str | None,
        typer.Option(
            help="What people say, an assumption: shares of the answer that the stated model expects, of"
            " other answers, of other talk, sounds and silence; by default"
            " expected=.7,other=.03,talk=.15,sound=.04,silence=.08."
        ),
    ] = None,
    timeout: Annotated[
        float, typer.Option(min=0.1, max=600, help="Seconds that a voice may take for a sentence.")
    ] = 20.0,
    seed: options.SeedOption = 0,
    out: options.OutOption = None,
) -> None:
    """Measure the observation model of a recogniser of speech.

    Writes to --out, by default out/observe: the model (heard.pomdp), what was learnt of the recogniser
    (heard.json), tables and a figure. After Ctrl-C the same command continues.
    """
    from lcorpp.domains import load_domain
    from lcorpp.hearing import answers, cases, noises, observing, results
    from lcorpp.worlds.speech import Recogniser, parse_voice

    folder = out or Path("out") / "observe"
    with output_files.lock_results(folder, None):
        loaded = load_domain(domain, preset=preset)
        names = answers.check_answers(loaded)
        kept = f"what was recognised is kept in {folder}; the same command continues"
        Recogniser(loaded.planning.utterances)  # an unknown word is found before the long work
        measured: cases.Cases
        if recordings is not None:
            measured, mix = cases.RecordedCases(recordings, names, seed), observing.recorded_noise()
            others = measured.kinds[len(names) :]
            assumption = answers.assume_without_kinds(others)
        else:
            mix = noises.parse_noises(noise)
            others, assumption = (answers.TALK, answers.SILENCE), answers.SYNTHETIC_SAID
        if said is not None:
            assumption = answers.parse_said(said, others)
        if recordings is None:
            speakers = cases.parse_voices(voices, lambda text: parse_voice(text, timeout=timeout))
            utterances = {name: loaded.planning.utterances[name] for name in names}
            with console.show_progress("synthesising sentences", kept=kept) as advance:
                measured = cases.SyntheticCases(utterances, speakers, mix, folder / "voices", seed, advance)
        with console.show_progress(
            "recognising, then choosing bins", len(measured.cases), kept=kept
        ) as advance:
            observed = observing.observe(
                loaded, measured, mix, assumption, folder, seed=seed, advance=advance
            )
        written = results.write_observed(observed, folder)
        print_observed(observed)
        console.out.print("wrote " + ", ".join(map(str, written)))


def print_observed(observed: Observed) -> None:
    """Print the recall, the bins and the values."""
    from lcorpp.hearing.results import describe_origin, find_wrong_share, list_recalls

    out = console.out
    out.print(describe_origin(observed))
    out.print(f"{'said':<10} {'noise':<12} recall in the test")
    for row in list_recalls(observed):
        out.print(f"{row['said']:<10} {row['noise']:<12} {row['recall']} (n = {row['n']})")
    for rows in observed.confidence.bins.values():
        out.print("; ".join(f"{name} from confidence {edge:g}" for name, edge in rows))
    out.print(f"an answer is heard as another one: {find_wrong_share(observed):.3f} of those heard")
    seconds = 1000 * observed.seconds.mean()
    out.print(f"CPU time of an utterance: {seconds:.0f} ms")
    promised = observed.value.interval.estimate
    out.print(
        f"value of the policy: {promised:.2f} by the measured model, {observed.simulated:.2f} simulated"
    )
    out.print("with the recogniser on the test; what people say is an assumption")
