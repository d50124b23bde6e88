"""Checks of names that one file of a domain folder uses and another one declares."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from lcorpp.errors import DomainError, NoValueError, TooLargeError, expected_one_of
from lcorpp.files import open_text
from lcorpp.planning import Pomdp
from lcorpp.reasoning import Program
from lcorpp.reasoning.language.signature import Attribute

if TYPE_CHECKING:
    from lcorpp.planning import GenerativeModel

BOOLEANS = ("true", "false")
"""The values of a Boolean attribute."""

Kind = Literal["states", "actions", "observations"]


def find_attribute_values(location: str, name: str, program: Program) -> tuple[str, ...]:
    """Return the values of a P-log attribute without arguments.

    Args:
        location: ``file:line: key`` that uses the attribute, the start of an error message.

    Raises:
        DomainError: `program` has no such attribute.
    """
    if name not in program.attributes:
        raise DomainError(
            f"{location}: {program.file} has no attribute {name!r}; {expected_one_of(program.attributes)}"
        )
    attribute = program.attributes[name]
    if attribute.arguments:
        raise DomainError(
            f"{location}: {name!r} takes arguments ({program.file}:{attribute.line}); expected one"
            f" without{_suggest_attribute(name, attribute, program)}"
        )
    return attribute.values


def _suggest_attribute(name: str, attribute: Attribute, program: Program) -> str:
    """Suggest an attribute without arguments that a unary predicate defines, e.g. one of ProbLog."""
    if len(attribute.arguments) != 1 or attribute.values != BOOLEANS:
        return ""
    rule = f"{name}_is : {attribute.arguments[0]}. {name}_is = X :- {name}(X)."
    return f", e.g. {name}_is by `{rule}`{_describe_translation(program)}"


def _describe_translation(program: Program) -> str:
    """Return where a program of ProbLog can have rules of P-log; "" for one of P-log."""
    from lcorpp.reasoning.language.translation.names import CHOICE

    if not any(name.startswith(CHOICE) for name in program.attributes):
        return ""
    return f", in the P-log that `lcorpp translate {program.file} -o FILE.plog` writes"


def check_defined(location: str, names: tuple[str, ...], program: Program) -> None:
    """Check that attributes have a value in every possible world, as shared variables and labels must.

    A program that is too large to be compiled is not checked here; its first question is.

    Args:
        location: ``file:line: key`` that uses the attributes, the start of an error message.

    Raises:
        DomainError: an attribute may have no value.
        ProgramError, UndefinedError: the program has no possible world, or violates a condition of P-log.
    """
    from lcorpp.reasoning import Reasoner  # imports the grounder and the compiler

    reasoner = Reasoner(program)
    for name in names:
        try:
            reasoner.exact(name)
        except TooLargeError:
            return
        except NoValueError as error:
            hint = ""
            if program.attributes[name].values == BOOLEANS:
                hint = f"; `-{name} :- not {name}.` makes it false{_describe_translation(program)}"
            raise DomainError(
                f"{location}: {name!r} needs a value in every possible world"
                f" ({program.file}:{program.attributes[name].line}): {str(error).partition(';')[0]}{hint}"
            ) from None


def check_same_names(location: str, names: tuple[str, ...], known: tuple[str, ...], what: str) -> None:
    """Check that `names` and `known` contain the same names, in any order.

    Args:
        location: ``file:line: key`` of `names`, the start of an error message.
        what: describes the known names, e.g. "the values of intention".

    Raises:
        DomainError: a name is unknown or missing.
    """
    for name in names:
        if name not in known:
            raise DomainError(f"{location}: {name!r} is not among {what}; {expected_one_of(known)}")
    for name in known:
        if name not in names:
            raise DomainError(f"{location}: {name!r} is missing; expected {what}: {', '.join(known)}")


def locate_declaration(pomdp: Pomdp | GenerativeModel, kind: Kind) -> str:
    """Return ``file:line`` of the declaration of the states, actions or observations in a POMDP file."""
    return _locate_line(pomdp.file, rf"\s*{kind}\s*:")


def locate_variable(pomdp: Pomdp, name: str) -> str:
    """Return ``file:line`` of the declaration of a state variable in a PomdpX file."""
    return _locate_line(pomdp.file, rf""".*vnamePrev\s*=\s*["']{re.escape(name)}(_?0)?["']""")


def _locate_line(file: str, pattern: str) -> str:
    """Return ``file:line`` of the first line that begins with a pattern, else the place of the model."""
    if Path(file).is_file():  # the place of a function is file:line already
        with open_text(file) as lines:
            for number, line in enumerate(lines, 1):
                if re.match(pattern, line):
                    return f"{file}:{number}"
    return file


def check_declared(location: str, name: str, pomdp: Pomdp | GenerativeModel, kind: Kind) -> None:
    """Check that a model has a state, action or observation of this name.

    Raises:
        DomainError: it has none.
    """
    known: tuple[str, ...] = getattr(pomdp, kind)
    if name not in known:
        raise DomainError(
            f"{location}: {locate_declaration(pomdp, kind)} has no {kind.removesuffix('s')} {name!r};"
            f" {expected_one_of(known)}"
        )
