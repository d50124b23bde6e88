"""The table `[simulation.present]` of a domain: the people whom each sense perceives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from lcorpp.domains.sections.learning import Sense
from lcorpp.domains.sections.names import check_defined, check_same_names, find_attribute_values
from lcorpp.domains.toml import TomlTable
from lcorpp.errors import DomainError, expected_one_of
from lcorpp.reasoning import Program


@dataclass(frozen=True)
class Presence:
    """The probability that a sense perceives a person; without signals of a sense there is no label of it.

    of: an attribute of the truth program, e.g. the side from which a person comes; None if all are alike.
    probability_of: value of `of` -> probability; of None the only key is "".

    Examples:
        >>> from lcorpp.domains.sections.presence import Presence
        >>> seen = Presence("side", {"front": 0.9, "behind": 0.0})
        >>> seen.probability({"side": "front", "time": "morning"})
        0.9
    """

    of: str | None
    probability_of: Mapping[str, float]

    def probability(self, person: Mapping[str, str]) -> float:
        """Return the probability that a person, attribute -> value, is perceived."""
        return self.probability_of["" if self.of is None else person[self.of]]


def read_presence(table: TomlTable, program: Program, senses: Sequence[Sense]) -> dict[str, Presence]:
    """Read the table: sense -> a probability, or a table of one attribute with a probability for each value.

    Args:
        program: the truth program.

    Raises:
        DomainError: an unknown sense, attribute or value, a missing value, or no probability.
    """
    names, presence = [sense.name for sense in senses], {}
    for name in table:
        if name not in names:
            raise DomainError(f"{table.location(name)}: no sense {name!r}; {expected_one_of(names)}")
        if table.is_table(name):
            presence[name] = _read_by_value(table.section(name), program)
            if (label := presence[name].of) in [sense.attribute for sense in senses]:
                raise DomainError(
                    f"{table.location(name)}: {label!r} is the label of a sense, which it has only if it"
                    " perceives the person; expected another attribute"
                )
        else:
            presence[name] = Presence(None, {"": table.number(name, 0, 1)})
    return presence


def _read_by_value(table: TomlTable, program: Program) -> Presence:
    """Read a table of one attribute, such as `side = { front = 0.9, behind = 0 }`."""
    if len(names := tuple(table)) != 1:
        raise DomainError(
            f"{table.location()}: is a table of {', '.join(names) or 'nothing'}; expected a probability, or"
            f" one attribute of {program.file} with a probability for each value"
        )
    (attribute,) = names
    location = table.location(attribute)
    values = find_attribute_values(location, attribute, program)
    check_defined(location, (attribute,), program)
    if not table.is_table(attribute):
        raise DomainError(f"{location}: expected a table of probabilities, e.g. {{ {values[0]} = 0.9 }}")
    row = table.section(attribute)
    what = f"the values of {attribute} at {program.file}:{program.attributes[attribute].line}"
    check_same_names(location, tuple(row), values, what)
    return Presence(attribute, {value: row.number(value, 0, 1) for value in values})
