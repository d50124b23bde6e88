"""Changes of a domain by one number each: what the axes of a sweep vary."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from fractions import Fraction
from functools import lru_cache
from itertools import count

import numpy as np
import numpy.typing as npt

from lcorpp.domains import Domain
from lcorpp.domains.sections.learning import Sense
from lcorpp.domains.sections.noisy_channels import compute_noisy_channel
from lcorpp.errors import DomainError, ModelError
from lcorpp.reasoning import Program, Reasoner, parse_plog, with_classifier
from lcorpp.reasoning.language.syntax import Number, Probability
from lcorpp.values import ConfusionMatrix


def with_discount(domain: Domain, discount: float) -> Domain:
    """Return the domain with another discount of the POMDP, below 1."""
    if discount == 1:
        raise DomainError("expected a discount below 1: a dialogue may go on forever")
    return replace(domain, planning=replace(domain.planning, model=replace(domain.pomdp, discount=discount)))


def with_cost(domain: Domain, action: str, cost: float) -> Domain:
    """Return the domain with another cost of an action, positive, in all states but terminal ones without."""
    a = domain.pomdp.action_index(action)
    states = domain.planning.state_values.any(axis=1) | (domain.pomdp.reward[a] != 0)
    return _with_reward(domain, a, states, -cost)


def with_limit(domain: Domain, name: str, bound: float) -> Domain:
    """Return the domain with another bound of a limit.

    Raises:
        DomainError: a probability has a bound above 1.
    """
    planning = domain.planning
    limits = tuple(replace(own, bound=bound) if own.name == name else own for own in planning.limits)
    try:
        for limit in limits:
            limit.make_limit(planning.state_values)
    except ModelError as error:
        raise DomainError(str(error)) from None
    return replace(domain, planning=replace(planning, limits=limits))


def with_report_reward(domain: Domain, value: str | None, reward: float, *, right: bool) -> Domain:
    """Return the domain with another reward of right, or of wrong reports.

    Args:
        value: the reported value; None changes the rewards of all reports.
    """
    state_values = domain.planning.state_values
    for action, reported in domain.planning.reports.items():
        if value in (None, reported):
            is_value = state_values[:, domain.values.index(reported)] > 0
            states = is_value if right else state_values.any(axis=1) & ~is_value
            domain = _with_reward(domain, domain.pomdp.action_index(action), states, reward)
    return domain


def _with_reward(domain: Domain, action: int, states: npt.NDArray[np.bool_], number: float) -> Domain:
    reward = domain.pomdp.reward.copy()
    reward[action, states] = number
    return replace(domain, planning=replace(domain.planning, model=replace(domain.pomdp, reward=reward)))


def with_rate(domain: Domain, sense: Sense, value: str, rate: float, *, known: bool, true: bool) -> Domain:
    """Return the domain with another probability that a sense predicts the right class of some people.

    The other labels of these people keep their proportions.

    Args:
        value: the class of these people.
        known: whether the robot's rules change. true: whether the simulated classifier changes.
    """
    if true:
        channels = domain.simulation.noisy_channels
        changed = _set_rate(channels[sense.name], sense, value, rate)
        simulation = replace(domain.simulation, noisy_channels={**channels, sense.name: changed})
        domain = replace(domain, simulation=simulation)
    if known:
        rates = _set_rate(compute_noisy_channel(domain.program, sense), sense, value, rate)
        matrix = np.array([[rates[row][sense.label_of[v]] for v in sense.classes] for row in sense.classes])
        confusion = ConfusionMatrix(sense.classes, matrix)
        domain = _with_program(
            domain,
            with_classifier(
                domain.program, sense.attribute, sense.of, confusion, sense.label_of, smoothing=Fraction(0)
            ),
        )
    return domain


def _set_rate(
    rates: Mapping[str, Mapping[str, float]], sense: Sense, value: str, rate: float
) -> dict[str, Mapping[str, float]]:
    """Return P(label | class) with another probability of the right label of a class."""
    right = sense.label_of[value]
    others = {label: p for label, p in rates[value].items() if label != right}
    total = sum(others.values())
    shares = {label: p / total if total else 1 / len(others) for label, p in others.items()}
    row = {label: (1 - rate) * share for label, share in shares.items()}
    return {**rates, value: {label: rate if label == right else row[label] for label in rates[value]}}


def with_prevalence(
    domain: Domain, attribute: str, value: str, prevalence: float, *, known: bool, true: bool
) -> Domain:
    """Return the domain with another share of the people who have a value of an attribute.

    The distribution of everything else given the attribute, and the proportions of its other values, remain.

    Args:
        known: whether the robot's program changes. true: whether the people change.
    """
    share = Fraction(str(prevalence))
    if known:
        domain = _with_program(domain, _reweight(domain.program, attribute, value, share))
    if true:
        program = _reweight(domain.simulation.true_program, attribute, value, share)
        domain = replace(domain, simulation=replace(domain.simulation, true_program=program))
    return domain


@lru_cache(maxsize=64)  # the robot and the people may have the same program, and so may configurations
def _reweight(program: Program, attribute: str, value: str, share: Fraction) -> Program:
    """Return a program in which a value has this probability: an observation selects the other worlds.

    An observed random term is true with probability w in the worlds that have the value and 1 in the others,
    or the other way round; that multiplies their odds by w.
    """
    p = Fraction(Reasoner(program).exact(attribute)[value])
    if not 0 < p < 1:
        raise DomainError(f"{attribute}={value} has probability {p}, so its prevalence cannot be changed")
    inside, outside = share * (1 - p), (1 - share) * p
    weights = inside / max(inside, outside), outside / max(inside, outside)
    term = next(name for n in count(1) if (name := f"counted_{n}") not in program.attributes)
    lines = [f"{term} : boolean.", f"random({term})."]
    for other in program.attributes[attribute].values:
        weight = weights[0] if other == value else weights[1]
        lines.append(f"pr({term}=true | {attribute}={other}) = {weight}.")
    return parse_plog("\n".join([str(program), *lines, f"obs({term}=true)."]), file=program.file)


def with_number(domain: Domain, atom: str, number: float, *, known: bool, true: bool) -> Domain:
    """Return the domain with another number of a pr-atom.

    Args:
        atom: see `list_atoms`.
        known: whether the robot's program changes. true: whether the people's program changes.
    """
    if known:
        domain = _with_program(domain, _set_number(domain.program, atom, number))
    if true:
        program = _set_number(domain.simulation.true_program, atom, number)
        domain = replace(domain, simulation=replace(domain.simulation, true_program=program))
    return domain


def list_atoms(program: Program) -> dict[str, int]:
    """Return the pr-atoms of a program without spaces, ``a=v|b=w``: the index of their statements."""
    return {
        normalise_atom(str(statement).partition("pr(")[2].rpartition(") = ")[0]): index
        for index, statement in enumerate(program.statements)
        if isinstance(statement, Probability)
    }


def normalise_atom(text: str) -> str:
    """Return the text of a pr-atom without spaces."""
    return re.sub(r"\s", "", text)


def _set_number(program: Program, atom: str, number: float) -> Program:
    """Return a program with another number of a pr-atom; unchanged if it has none."""
    index = list_atoms(program).get(normalise_atom(atom))
    if index is None:
        return program
    statements = list(program.statements)
    statement = statements[index]
    assert isinstance(statement, Probability)
    statements[index] = replace(statement, number=Number(Fraction(str(number)), at=statement.at))
    return Program(program.file, tuple(statements), program.semantics, program.names)


def _with_program(domain: Domain, program: Program) -> Domain:
    return replace(domain, reasoning=replace(domain.reasoning, program=program))
