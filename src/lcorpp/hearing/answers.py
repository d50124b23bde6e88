"""What people say: an assumption about the answers to each action, on top of the stated observation model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from lcorpp.domains import Domain
from lcorpp.errors import DataError, DomainError, expected_one_of
from lcorpp.values import Array
from lcorpp.worlds.speech.confidence import NONE

TALK, SOUND, SILENCE = "talk", "sound", "silence"
"""What is heard besides answers, in synthetic measurements: talk, sounds without speech, and nothing."""

EXPECTED, OTHER = "expected", "other"
"""In an assumption: the answer that the stated model expects, and all other answers together."""

SYNTHETIC_SAID = {EXPECTED: 0.7, OTHER: 0.03, TALK: 0.15, SOUND: 0.04, SILENCE: 0.08}
"""The assumption without others, for synthetic voices."""


@dataclass(frozen=True, eq=False)
class SaidModel:
    """What people say after each action.

    kinds: (K,) the answers, then what else was measured, e.g. talk and silence.
    probabilities: (A, S, K) P(said | a, s'); zeros in rows of the model that are kept as stated: those of
        reports and terminal states.
    """

    kinds: tuple[str, ...]
    probabilities: Array

    @property
    def is_measured(self) -> Array:
        """(A, S) 1 for the rows that are measured, 0 for those kept as stated."""
        measured: Array = self.probabilities.sum(axis=2)
        return measured


def parse_said(text: str, others: Sequence[str]) -> dict[str, float]:
    """Return the assumption of a text such as ``expected=.9,other=.02,talk=.03,silence=.05``.

    Args:
        others: what was measured besides answers.

    Raises:
        DataError: a name is unknown, or the probabilities do not sum to 1.
    """
    known = (EXPECTED, OTHER, *others)
    said: dict[str, float] = {}
    for item in text.split(","):
        name, _, number = (part.strip() for part in item.partition("="))
        if name not in known or name in said:
            raise DataError(f"what is said, {item!r}: {expected_one_of(known)}, each once")
        try:
            said[name] = float(number)
        except ValueError:
            said[name] = np.nan
        if not 0 <= said[name] <= 1:
            raise DataError(f"what is said, {item!r}: expected a probability after the =")
    total = sum(said.values())
    if abs(total - 1) > 1e-6:
        raise DataError(f"what is said, {text!r}: the probabilities sum to {total:g}, not 1")
    return said


def assume_without_kinds(others: Sequence[str]) -> dict[str, float]:
    """Return the default assumption if talk, sounds and silence are not measured apart, as in recordings."""
    expected = {EXPECTED: SYNTHETIC_SAID[EXPECTED], OTHER: SYNTHETIC_SAID[OTHER]}
    rest = sum(SYNTHETIC_SAID.values()) - sum(expected.values())
    return {**expected, **{name: rest / len(others) for name in others}}


def check_answers(domain: Domain) -> tuple[str, ...]:
    """Return the observations that people give by sentences; all others but `NONE` are errors.

    Raises:
        DomainError: the domain has no utterances, or an observation that no sentence gives.
    """
    utterances, observations = domain.planning.utterances, domain.pomdp.observations
    file = f"{domain.folder}/domain.toml"
    if not utterances or NONE in utterances:
        raise DomainError(
            f"{file}: expected [planning.utterances] with sentences for each observation but {NONE!r}; see"
            " docs/guides/robot/speech.md"
        )
    for name in observations:
        if name not in utterances and name != NONE:
            raise DomainError(
                f"{file}: [planning.utterances] has no sentences for the observation {name!r}, so speech"
                " cannot give it; choose a preset without it"
            )
    if NONE not in observations:
        raise DomainError(f"{file}: the model has no observation {NONE!r}, which silence gives")
    return tuple(name for name in observations if name != NONE)


def assume_said(domain: Domain, assumption: Mapping[str, float], others: Sequence[str]) -> SaidModel:
    """Return P(said | a, s').

    In each row of the stated model the most probable answer is the expected one, and answers that the action
    never gets are never said. Where the stated model expects no answer, e.g. after a turn that fails, people
    are silent.

    Args:
        assumption: as `parse_said` returns it.
        others: what was measured besides answers; the last is silence.
    """
    answers = check_answers(domain)
    kinds, pomdp = (*answers, *others), domain.pomdp
    said = np.zeros((len(pomdp.actions), len(pomdp.states), len(kinds)))
    stated = pomdp.observation.dense[:, :, [pomdp.observations.index(name) for name in answers]]
    for a, action in enumerate(pomdp.actions):
        possible = stated[a].max(axis=0) > 0  # (answers,)
        if action in domain.planning.reports:
            continue
        for s in range(len(pomdp.states)):
            if s in domain.planning.terminal:
                continue
            if not stated[a, s].any():
                said[a, s, -1] = 1.0
                continue
            expected = int(np.argmax(stated[a, s]))
            unexpected = [int(i) for i in np.flatnonzero(possible) if i != expected]
            said[a, s, expected] = assumption.get(EXPECTED, 0.0)
            said[a, s, unexpected or [expected]] += assumption.get(OTHER, 0.0) / max(len(unexpected), 1)
            for place, name in enumerate(others, len(answers)):
                said[a, s, place] = assumption.get(name, 0.0)
    return SaidModel(kinds, said)
