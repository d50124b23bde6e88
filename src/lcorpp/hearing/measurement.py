"""Run the recogniser on all cases of a measurement; what is recognised is kept case by case."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

from lcorpp.files import make_folder
from lcorpp.hearing.answers import SOUND
from lcorpp.hearing.cases import Case, Cases
from lcorpp.values import Array, freeze
from lcorpp.work_units.store import UnitStore
from lcorpp.worlds.speech.confidence import SPEECH, Confidence, fit_factor
from lcorpp.worlds.speech.features import FEATURES
from lcorpp.worlds.speech.listener import recognise_all
from lcorpp.worlds.speech.recogniser import Recogniser, Recognition

STORE = "recognitions.sqlite"
"""The file of what was recognised, in the folder of a measurement."""

FOLDS = 5
"""Folds of the cross-fitting: the confidence of a sentence is learnt from other sentences."""


@dataclass(frozen=True, eq=False)
class Result:
    """What was recognised in a case.

    recognitions: of its utterances, in their order. seconds: CPU time of finding and recognising them.
    """

    case: Case
    recognitions: tuple[Recognition, ...]
    seconds: float


def measure(
    cases: Cases,
    recogniser: Recogniser,
    folder: Path,
    identity: dict[str, str],
    advance: Callable[[int, int], None] = lambda done, total: None,
) -> list[Result]:
    """Recognise the utterances of all cases.

    Args:
        folder: keeps the results; the same measurement continues with those of an earlier run.
        identity: what the results depend on besides the case, name -> text.
        advance: receives the numbers of finished and of all cases.

    Raises:
        DataError: the folder has the results of another measurement.
        FileError: the folder cannot be written.
    """
    results = []
    with UnitStore(make_folder(folder) / STORE, identity) as store:
        for case in cases.cases:
            if case.key not in store:
                began = process_time()
                samples = cases.samples(case)
                began = process_time()
                found = list(recognise_all(recogniser, (samples,)))
                store.add(case.key, _to_json(found, process_time() - began))
            results.append(_from_json(case, store[case.key]))
            advance(len(results), len(cases.cases))
    return results


def score_results(results: Sequence[Result], weights: Mapping[str, Array]) -> tuple[Confidence, list[Array]]:
    """Learn the confidence from the tuning cases, and return it without bins.

    Args:
        weights: factor of the confidence -> weights (n,) of the cases; without weight it learns nothing from
            a case.

    Returns:
        The confidence, and for each result the confidences of its recognitions: of tuning cases by
        cross-fitting over sentences and kinds of sounds, of test cases by the returned confidence.

    Raises:
        DataError: too few recognitions are right, or wrong.
    """
    tuning = [i for i, result in enumerate(results) if not result.case.is_test]
    sentences = sorted({results[i].case.sentence for i in tuning})
    order = np.random.default_rng(0).permutation(len(sentences)).tolist()
    fold_of = {sentences[place]: rank % FOLDS for rank, place in enumerate(order)}
    whole = _fit(results, tuning, weights)
    parts = [
        _fit(results, [i for i in tuning if fold_of[results[i].case.sentence] != fold], weights)
        for fold in range(FOLDS)
    ]
    scores = []
    for result in results:
        model = whole if result.case.is_test else parts[fold_of[result.case.sentence]]
        rows = np.reshape([found.features for found in result.recognitions], (-1, len(FEATURES)))
        scores.append(model.score(rows))
    return whole, scores


def _fit(results: Sequence[Result], chosen: Sequence[int], weights: Mapping[str, Array]) -> Confidence:
    factors = {}
    for name, own in weights.items():
        rows, positive, weight = [], [], []
        for i in chosen:
            said = results[i].case.said
            for found in results[i].recognitions:
                if found.answer is not None and own[i] > 0:
                    rows.append(found.features)
                    positive.append(said != SOUND if name == SPEECH else found.answer == said)
                    weight.append(own[i])
        table = np.reshape(rows, (-1, len(FEATURES)))
        factors[name] = fit_factor(table, np.array(positive, bool), np.array(weight))
    return Confidence(FEATURES, factors, {})


def _to_json(found: Sequence[Recognition], seconds: float) -> dict[str, Any]:
    rows = [{"answer": r.answer, "text": r.text, "features": r.features.tolist()} for r in found]
    return {"seconds": round(seconds, 4), "recognitions": rows}


def _from_json(case: Case, table: dict[str, Any]) -> Result:
    rows = (Recognition(r["answer"], r["text"], freeze(r["features"])) for r in table["recognitions"])
    return Result(case, tuple(rows), table["seconds"])


def describe_recogniser(utterances: Mapping[str, Sequence[str]], seed: int, source: str) -> dict[str, str]:
    """Return what recognitions depend on besides their case, for `measure`.

    Args:
        source: of the cases: what makes their speech.
    """
    return {
        "sentences": sha256(json.dumps({k: list(v) for k, v in utterances.items()}).encode()).hexdigest(),
        "features": ", ".join(FEATURES),
        "seed": str(seed),
        "source": source,
    }
