"""Speech: recall by noise, babble alone, CPU time, and the value with the recogniser in the loop.

    OMP_NUM_THREADS=1 python benchmarks/robot/speech.py OUT --piper MODEL.onnx [--unheard flite:kal]

Sentences of the intention domain and off-topic talk, by flite's voices and piper, and sounds without speech,
in a mix of noises; half of the sentences and of the kinds of sounds are for tuning, the figures are of the
other half. Then the voices of --unheard, by which nothing was tuned, say the sentences of the test in other
noise. What was recognised is kept in OUT.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from lcorpp.domains import load_domain
from lcorpp.hearing.answers import SILENCE, SYNTHETIC_SAID
from lcorpp.hearing.bins import collect_cases
from lcorpp.hearing.cases import Case, SyntheticCases, parse_voices
from lcorpp.hearing.measurement import describe_recogniser, measure
from lcorpp.hearing.noises import parse_noises
from lcorpp.hearing.observing import Observed, observe
from lcorpp.hearing.rates import HeardCases
from lcorpp.hearing.results import (
    describe_origin,
    find_answer_bins,
    find_wrong_share,
    write_observed,
)
from lcorpp.values import Array
from lcorpp.worlds.speech import FEATURES, Recogniser, parse_voice

VOICES = "flite:kal16,flite:awb,flite:rms,flite:slt"
NOISES = "clean,white:20,babble:20"


def print_recall(title: str, observed: Observed, cases: HeardCases) -> None:
    """Print the recall of each answer, and of no answer, by noise, as rows of a table."""
    print(f"\n{title}\n\n| said | {' | '.join(cases.noises)} |\n|---|{'---|' * len(cases.noises)}")
    for kind in cases.kinds:
        cells = [cases.interval(kind, noise, find_answer_bins(observed, kind)) for noise in cases.noises]
        print(f"| {kind} | {' | '.join(f'{interval:.2f} ({n})' for interval, n in cells)} |")
    for noise in cases.noises:
        share, n = cases.interval(SILENCE, noise, find_answer_bins(observed, "pos"))
        print(f"\n{noise} alone is taken for pos: {share:.3f} (n = {n})")


class OtherNoise(SyntheticCases):
    """The same cases in other noise than by default."""

    def samples(self, case: Case, repeat: int = 1) -> Array:
        return super().samples(case, 1)


def hear_others(observed: Observed, voices: str, folder: Path, seed: int) -> HeardCases:
    """Return what is heard of the sentences of the test, by other voices and in other noise."""
    mix, utterances = parse_noises(NOISES), observed.domain.planning.utterances
    cases = OtherNoise(utterances, parse_voices(voices, parse_voice), mix, folder / "voices", seed)
    cases.cases = [case for case in cases.cases if case.is_test]
    identity = describe_recogniser(utterances, seed, f"benchmark of {voices}")
    results = measure(cases, Recogniser(utterances), folder / "others", identity)
    scores = [
        observed.confidence.score(np.reshape([r.features for r in x.recognitions], (-1, len(FEATURES))))
        for x in results
    ]
    scored = collect_cases(results, scores, cases.kinds, tuple(utterances), mix)
    return scored.hear(observed.confidence.bins, test=True)


def main(
    out: Path,
    piper: Annotated[
        Path | None, typer.Option(help="A model of piper, whose program is on the path.")
    ] = None,
    seed: int = 0,
    unheard: str = "flite:kal,espeak-ng:en-us",
) -> None:
    """Measure, and print the figures of benchmarks/results/speech.md."""
    domain, mix = load_domain("intention"), parse_noises(NOISES)
    voices = parse_voices(VOICES + (f",piper:{piper}" if piper else ""), parse_voice)
    cases = SyntheticCases(domain.planning.utterances, voices, mix, out / "voices", seed)
    observed = observe(domain, cases, mix, SYNTHETIC_SAID, out, seed=seed)
    write_observed(observed, out)
    print(describe_origin(observed))
    print_recall("Test sentences, voices of the tuning", observed, observed.test)
    print_recall("Test sentences, other voices", observed, hear_others(observed, unheard, out, seed))
    print(f"\nbins: {dict(observed.confidence.bins)}")
    seconds = observed.seconds
    print(f"CPU time of an utterance: mean {1e3 * seconds.mean():.0f} ms,", end=" ")
    print(f"95 % below {1e3 * np.quantile(seconds, 0.95):.0f} ms, most {1e3 * seconds.max():.0f} ms")
    print(f"an answer is heard as another one: {find_wrong_share(observed):.3f} of those heard")
    promised = observed.value.interval.estimate
    print(f"value: promised {promised:.2f}, simulated {observed.simulated:.2f},", end=" ")
    print(
        f"shortfall {100 * observed.shortfall:.2f} %; the stated model promises {observed.stated_value:.2f}"
    )


if __name__ == "__main__":
    typer.run(main)
