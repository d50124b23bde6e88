"""The ``<Variable>`` section of PomdpX."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from lcorpp.errors import ModelError
from lcorpp.planning.factored.variables import AFTER, Variable, build_scope, check_word
from lcorpp.planning.formats.numbers import is_count
from lcorpp.planning.formats.pomdpx.document import Document, Element

MAX_COUNT = 1_000_000
"""Maximum number of values of a variable that only counts them."""

MAX_DIGITS = 9
"""Longer numbers are not converted: int() refuses more than 4300 digits."""

VALUE_PREFIXES = {"StateVar": "s", "ObsVar": "o", "ActionVar": "a"}
"""Names of the values of a variable that only counts them: ``s0``, ``s1`` and so on."""

_NAME_ATTRIBUTES = {
    "StateVar": ("vnamePrev", "vnameCurr"),
    "ObsVar": ("vname",),
    "ActionVar": ("vname",),
    "RewardVar": ("vname",),
}
_TRUTH_VALUES = {"true": True, "1": True, "false": False, "0": False}


class Declarations:
    """The variables that a ``<Variable>`` element declares.

    states, actions, observations: the variables. scope: all of them, by our names.
    names: name in the file -> our name; ``x'`` is x after an action.
    rewards: reward name -> its element.

    Raises:
        ParseError: a variable is malformed, a name is repeated, or there is no state or no action.
    """

    def __init__(self, document: Document, element: Element) -> None:
        self.document = document
        self.names: dict[str, str] = {}
        self.rewards: dict[str, Element] = {}
        children = document.check_children(element, tuple(_NAME_ATTRIBUTES))
        names = self._check_names(children)
        states = [child.attributes for child in children if child.name == "StateVar"]
        state_names = _shorten_state_names(states, names)
        variables: dict[str, list[Variable]] = {kind: [] for kind in VALUE_PREFIXES}
        for child in children:
            first, *others = (child.attributes[attribute] for attribute in _NAME_ATTRIBUTES[child.name])
            if child.name == "RewardVar":
                document.check_children(child, (), ("vname",))
                self.rewards[first] = child
                continue
            self.names[first] = state_names.get(first, first)
            self.names |= dict.fromkeys(others, self.names[first] + AFTER)
            variables[child.name].append(self._read_variable(child, self.names[first]))
        # without observation variables the robot observes only parts of the state
        for kind, what in (("StateVar", "state"), ("ActionVar", "action")):
            if not variables[kind]:
                raise document.error(element, f"a problem needs a variable for the {what}: <{kind}>")
        self.states, self.actions, self.observations = (
            tuple(variables[kind]) for kind in ("StateVar", "ActionVar", "ObsVar")
        )
        self.scope = build_scope(self.states, self.actions, self.observations)

    def _check_names(self, children: Sequence[Element]) -> set[str]:
        """Check that each name is a single word and unique; return all names."""
        names: set[str] = set()
        for child in children:
            for attribute in _NAME_ATTRIBUTES[child.name]:
                name = self.document.attribute(child, attribute)
                if name in names:
                    raise self.document.error(child, f"two variables have the name {name!r}")
                if name == "null":
                    raise self.document.error(child, "'null' cannot be a name: it means no parents")
                try:
                    check_word(name, attribute)
                except ModelError as error:
                    raise self.document.error(child, str(error)) from None
                names.add(name)
        return names

    def _read_variable(self, element: Element, name: str) -> Variable:
        document = self.document
        text = document.attribute(element, "fullyObs", "false") if element.name == "StateVar" else "false"
        # published files contain Python's True
        observed = _TRUTH_VALUES.get(text.strip().lower())
        if observed is None:
            raise document.error(element, f"fullyObs must be 'true' or 'false', not {text[:40]!r}")
        attributes = (*_NAME_ATTRIBUTES[element.name], *(["fullyObs"] if element.name == "StateVar" else []))
        document.check_children(element, ("ValueEnum", "NumValues"), attributes)
        child = document.only_child(element, "ValueEnum", "NumValues")
        if child.name == "ValueEnum":
            values = document.words(child)
        else:
            word = document.word(child)
            if not is_count(word) or len(word) > MAX_DIGITS or not 0 < int(word) <= MAX_COUNT:
                message = f"expected a number of values from 1 to {MAX_COUNT}, found {word[:40]!r}"
                raise document.error(child, message, 0)
            values = [f"{VALUE_PREFIXES[element.name]}{i}" for i in range(int(word))]
        try:
            return Variable(name, tuple(values), observed)
        except ModelError as error:
            raise document.error(child, str(error)) from None


def _shorten_state_names(states: Sequence[Mapping[str, str]], used: set[str]) -> dict[str, str]:
    """Return our names of the state variables by `vnamePrev`: ``x`` for ``x_0`` and ``x_1``."""
    short: dict[str, str] = {}
    for attributes in states:
        before, after = attributes["vnamePrev"], attributes["vnameCurr"]
        stem = before[:-1].removesuffix("_")
        is_pair = before.endswith("0") and after == before[:-1] + "1"
        short[before] = stem if is_pair and stem else before
    stems = list(short.values())
    # a name that would become ambiguous stays as in the file
    return {
        before: name if stems.count(name) == 1 and name not in used else before
        for before, name in short.items()
    }
