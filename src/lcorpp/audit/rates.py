"""Findings about the rates of senses and the observation model."""

from __future__ import annotations

from collections.abc import Sequence
from math import prod

import numpy as np

from lcorpp.audit.answer_rates import AnswerRates
from lcorpp.audit.estimates import RateEstimate
from lcorpp.audit.intervals import compare_log_odds
from lcorpp.audit.logged_people import LoggedPeople
from lcorpp.domains import Domain
from lcorpp.notebook import join_some
from lcorpp.values import SharedValue, format_value


def list_rates(people: LoggedPeople, rates: AnswerRates, max_share: float) -> list[RateEstimate]:
    """List the probability of each label and answer.

    Args:
        max_share: a rate is not determined if its variance is more than this share of that of its weak prior.
    """
    domain, estimates, values = people.domain, list[RateEstimate](), people.domain.values
    senses, questions = domain.senses, people.dialogue.questions
    tables = [*people.stated_rates, *people.dialogue.tables]
    outcomes = [*people.labels, *[domain.pomdp.observations] * len(questions)]
    names = [*[sense.name for sense in senses], *questions]
    for place, (name, stated) in enumerate(zip(names, tables, strict=True)):
        for row in rates.list_rows(1 + place):
            members = np.flatnonzero(rates.is_of_value[:, row[0]])
            about = describe_values(people.domain, members.tolist())
            for j in row if len(row) > 2 else row[:1]:
                outcome = int(rates.outcome[j])
                number = None if stated is None else float(stated[members[0], outcome])
                estimate, variance, prior = rates.describe_cell(j, row)
                interval, p_value = compare_log_odds(number, estimate, variance)
                is_determined = variance <= max_share * prior
                is_sense, label = place < len(senses), outcomes[place][outcome]
                estimates.append(
                    RateEstimate(
                        name=f"{name}: {label} if {about}",
                        stated=number,
                        estimate=estimate,
                        interval=interval if is_determined else None,
                        p_value=p_value if is_determined else 1.0,
                        is_sense=is_sense,
                        rule=_write_rule(people, place, label, values[members[0]]) if is_sense else "",
                    )
                )
    return estimates


def describe_values(domain: Domain, members: Sequence[int]) -> str:
    """Describe shared values, of several variables by conditions such as ``item=tea or milk, room=lab``."""
    chosen = [domain.values[v] for v in members]
    names = domain.reasoning.shared
    if len(names) == 1:
        return " or ".join(map(format_value, chosen))
    every, own = (
        [list(dict.fromkeys(column)) for column in zip(*rows, strict=True)]
        for rows in (domain.values, chosen)
    )
    if prod(map(len, own)) > len(chosen):  # the conditions on the variables depend on each other
        return join_some([format_value(value) for value in chosen])
    return ", ".join(
        f"{name}={' or '.join(few)}"
        for name, few, all_ in zip(names, own, every, strict=True)
        if len(few) < len(all_)
    )


def _write_rule(people: LoggedPeople, place: int, label: str, value: SharedValue) -> str:
    """Write the pr-atom of a label without its number; "" if the sense classifies no shared variable."""
    sense = people.domain.senses[place]
    classes = people.domain.reasoning.split(value)
    return f"pr({sense.attribute}={label} | {sense.of}={classes[sense.of]})" if sense.of in classes else ""
