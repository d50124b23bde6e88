"""The error rates of senses with soft evidence, which the robot's program lacks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction

from lcorpp.decision.strategies import Rates
from lcorpp.domains import Domain
from lcorpp.reasoning import Reasoner
from lcorpp.trust.sources.stated import StatedSources
from lcorpp.values import JEFFREYS, ConfusionMatrix


def compute_soft_rates(
    domain: Domain,
    confusions: Mapping[str, ConfusionMatrix],
    smoothing: Fraction = JEFFREYS,
    *,
    soft: Sequence[str],
) -> Rates:
    """Return the rates of senses with soft evidence, which the robot's program lacks.

    Args:
        confusions: sense -> its matrix; without one the rates of the domain's program remain.
        smoothing: of the matrices. soft: the senses with soft evidence.
    """
    if not soft:
        return {}
    program = domain.program_for(confusions, smoothing)
    sources = StatedSources(Reasoner(program), domain, domain.marginal(domain.pomdp.start))
    rates = {}
    for name in soft:
        attribute = domain.find_sense(name).attribute
        labels, table = sources.compute_rates(attribute)
        rates[attribute] = dict(zip(labels, table.T, strict=True))
    return rates
