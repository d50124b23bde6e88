"""The reasoner of a robot's decisions: that of its program, or of the user's own code."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lcorpp.domains.sections.learning import Sense
from lcorpp.domains.sections.noisy_channels import compute_noisy_channel
from lcorpp.domains.sections.reasoning import ReasoningSection
from lcorpp.protocols import Reasoner
from lcorpp.reasoning import Program


def make_reasoner(section: ReasoningSection, senses: Sequence[Sense], program: Program) -> Reasoner:
    """Return the reasoner of decisions.

    Args:
        program: of the section, with the rules of the robot's classifiers.

    Raises:
        DomainError: as of `OwnReasoners`.
        ProgramError: the rates of a sense for one of the user's own cannot be computed from the program.
    """
    if section.own_reasoners is None:
        from lcorpp.reasoning import Reasoner as ProgramReasoner  # imports the grounder and the compiler

        return ProgramReasoner(program)
    rates = {sense.attribute: compute_noisy_channel(program, sense) for sense in senses}
    label_rates = {}
    for sense in senses:
        if sense.of in section.shared:
            labels, rows = program.attributes[sense.attribute].values, rates[sense.attribute]
            classes = [section.split(value)[sense.of] for value in section.values]
            table = np.array([[rows[name][label] for label in labels] for name in classes])
            label_rates[sense.attribute] = labels, table
    return section.own_reasoners(program, rates, section.subject, section.values, label_rates)
