"""The keys of `[planning]` for a recogniser of speech: sentences, and what was learnt of it."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

from lcorpp.domains.sections.files import find_file
from lcorpp.domains.sections.names import check_declared
from lcorpp.domains.toml import TomlTable
from lcorpp.errors import DomainError, FileError
from lcorpp.planning import Pomdp

if TYPE_CHECKING:
    from lcorpp.planning import GenerativeModel

SENTENCE = re.compile(r"[A-Za-z']+( [A-Za-z']+)*")
"""Words with one space between them."""


def read_utterances(table: TomlTable, model: Pomdp | GenerativeModel) -> dict[str, tuple[str, ...]]:
    """Read `utterances`: observation -> sentences, each with its words in lower case."""
    section = table.section("utterances")
    utterances: dict[str, tuple[str, ...]] = {}
    observation_of: dict[str, str] = {}
    for observation in section:
        location = section.location(observation)
        check_declared(location, observation, model, "observations")
        sentences = tuple(sentence.lower() for sentence in section.names(observation))
        for sentence in sentences:
            if not SENTENCE.fullmatch(sentence):
                raise DomainError(
                    f"{location}: {sentence!r} is not a sentence; expected words of letters and apostrophes"
                    " with one space between them"
                )
            if sentence in observation_of:
                raise DomainError(
                    f"{location}: {sentence!r} is already a sentence of {observation_of[sentence]!r};"
                    " expected each sentence once"
                )
            observation_of[sentence] = observation
        utterances[observation] = sentences
    return utterances


def read_recogniser(table: TomlTable, folder: Path) -> Path | None:
    """Read `recogniser`, a file in the folder."""
    if "recogniser" not in table:
        return None
    path = find_file(table, "recogniser", folder)
    if not path.is_file():
        raise FileError(f"{table.location('recogniser')}: there is no file {path}")
    return path
