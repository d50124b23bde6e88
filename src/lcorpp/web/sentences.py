"""Sentences for rules of a P-log program that fire in a possible world."""

from __future__ import annotations

from collections.abc import Mapping

from lcorpp.reasoning import FiredRule


def write_sentence(rule: FiredRule, world: Mapping[str, str]) -> str:
    """Return a fired rule as a sentence: ``If identity is visitor, time is noon with probability 70 %.``

    If a pr-atom is about another value than that of the world, the sentence ends ``; here it is evening.``

    Args:
        world: term -> value.
    """
    effect = f"{_name(rule.term)} is {_name(rule.value)}"
    if rule.probability is not None:
        effect += f" with probability {100 * float(rule.probability):.4g} %"
        if world.get(rule.term, rule.value) != rule.value:
            effect += f"; here it is {_name(world[rule.term])}"
    conditions = [
        f"{_name(term)} is {_name(value)}" if value else f"{_name(term)} has no value"
        for term, value in rule.conditions
    ]
    text = f"If {' and '.join(conditions)}, {effect}." if conditions else f"{effect}."
    return text[0].upper() + text[1:]


def _name(text: str) -> str:
    return text.replace("_", " ").replace("(", " of ").replace(")", "")
