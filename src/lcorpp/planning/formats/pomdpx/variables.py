"""The variables of PomdpX."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from lcorpp.errors import ModelError
from lcorpp.planning.factored.variables import AFTER, Variable, check_word
from lcorpp.planning.formats.numbers import is_count
from lcorpp.planning.formats.pomdpx.xml import Document, Element

MAX_COUNT = 1_000_000
"""The most values a count may ask for."""

_ATTRIBUTES = {
    "StateVar": ("vnamePrev", "vnameCurr", "fullyObs"),
    "ObsVar": ("vname",),
    "ActionVar": ("vname",),
    "RewardVar": ("vname",),
}

_LETTERS = {"StateVar": "s", "ObsVar": "o", "ActionVar": "a"}
"""What the values of a variable are called that only counts them: ``s0``, ``s1`` and so on."""


class Declared:
    """What a ``<Variable>`` declares.

    states, actions, observations: the variables.
    names: our names by those of the file; ``x'`` for x after an action.
    rewards: the elements of the rewards by name.

    Raises:
        ParseError: a variable is malformed, two have the same name, or there is none for state or action.
    """

    def __init__(self, document: Document, element: Element) -> None:
        self.document = document
        self.names: dict[str, str] = {}
        self.rewards: dict[str, Element] = {}
        children = document.children(element, tuple(_ATTRIBUTES))
        own = _own_names(
            [child.attributes for child in children if child.name == "StateVar"], self._taken(children)
        )
        found: dict[str, list[Variable]] = {kind: [] for kind in _LETTERS}
        for child in children:
            if child.name == "RewardVar":
                document.children(child, (), _ATTRIBUTES[child.name])
                self.rewards[child.attributes["vname"]] = child
            elif child.name == "StateVar":
                before, after = child.attributes["vnamePrev"], child.attributes["vnameCurr"]
                self.names |= {before: own[before], after: own[before] + AFTER}
                found[child.name].append(self._variable(child, own[before], observed=self._observed(child)))
            else:
                name = child.attributes["vname"]
                self.names[name] = name
                found[child.name].append(self._variable(child, name))
        for kind, what in (("StateVar", "state"), ("ActionVar", "action")):
            if not found[kind]:
                raise document.error(element, f"a problem needs a variable for the {what}: <{kind}>")
        self.states, self.actions, self.observations = (
            tuple(found[kind]) for kind in ("StateVar", "ActionVar", "ObsVar")
        )

    def _taken(self, children: Sequence[Element]) -> set[str]:
        """All names of the file; each is a word, and none is there twice."""
        taken: set[str] = set()
        for child in children:
            for attribute in _ATTRIBUTES[child.name][:2]:
                name = self.document.attribute(child, attribute)
                if name in taken:
                    raise self.document.error(child, f"two variables have the name {name!r}")
                if name == "null":
                    raise self.document.error(child, "'null' cannot be a name: it stands for no parents")
                try:
                    check_word(name, attribute)
                except ModelError as error:
                    raise self.document.error(child, str(error)) from None
                taken.add(name)
        return taken

    def _variable(self, element: Element, name: str, *, observed: bool = False) -> Variable:
        document = self.document
        document.children(element, ("ValueEnum", "NumValues"), _ATTRIBUTES[element.name])
        child = document.only(element, "ValueEnum", "NumValues")
        values = document.words(child) if child.name == "ValueEnum" else self._counted(child, element.name)
        try:
            return Variable(name, tuple(values), observed)
        except ModelError as error:
            raise document.error(child, str(error)) from None

    def _counted(self, element: Element, kind: str) -> list[str]:
        word = self.document.word(element)
        if not is_count(word) or len(word) > 9 or not 0 < int(word) <= MAX_COUNT:
            message = f"expected a number of values from 1 to {MAX_COUNT}, found {word[:40]!r}"
            raise self.document.error(element, message, 0)
        return [f"{_LETTERS[kind]}{i}" for i in range(int(word))]

    def _observed(self, element: Element) -> bool:
        text = self.document.attribute(element, "fullyObs", "false")
        # published scripts write Python's True
        if text.strip().lower() not in ("true", "false", "1", "0"):
            raise self.document.error(element, f"fullyObs must be 'true' or 'false', not {text[:40]!r}")
        return text.strip().lower() in ("true", "1")


def _own_names(states: Sequence[Mapping[str, str]], taken: set[str]) -> dict[str, str]:
    """Our names of the state variables by their names before: ``x`` for ``x_0`` and ``x_1``."""
    found: dict[str, str] = {}
    for attributes in states:
        before, after = attributes["vnamePrev"], attributes["vnameCurr"]
        stem = before[:-1].removesuffix("_")
        found[before] = stem if (before, after) == (before[:-1] + "0", before[:-1] + "1") and stem else before
    used = list(found.values())
    # where that leaves two with the same name, each keeps its own
    return {
        before: before if name != before and (used.count(name) > 1 or name in taken) else name
        for before, name in found.items()
    }
