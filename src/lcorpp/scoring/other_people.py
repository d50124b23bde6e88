"""People of another domain: whether a robot can decide about them, and its channels for them.

A model that was learnt, or changed, is scored so with people of the true one.
"""

from __future__ import annotations

from lcorpp.domains import Domain
from lcorpp.errors import DomainError
from lcorpp.simulation import NoisyChannel


def check_people(domain: Domain, people: Domain) -> None:
    """Check that the robot of a domain can decide about people of another one.

    Raises:
        DomainError: they have other shared values or labels, lack an action, a sense or a fact of the robot,
            or have a value of a fact or an answer that the robot does not know.
    """
    name = f"the domain of the people, {people.folder},"
    for variable in domain.reasoning.shared:
        _check_values(domain, people, variable, name, "shared", both=True)
    for fact in domain.observed:
        _check_values(domain, people, fact, name, "observed", both=False)
    if set(people.reasoning.shared) != set(domain.reasoning.shared):
        raise DomainError(
            f"{name} shares {', '.join(people.reasoning.shared)}; expected"
            f" {', '.join(domain.reasoning.shared)} as in {domain.folder}"
        )
    for sense in domain.senses:
        own, other = sense.label_of, people.find_sense(sense.name).label_of
        if dict(own) != dict(other):
            raise DomainError(
                f"{name} has the labels {', '.join(other.values())} of {', '.join(other)} for {sense.name};"
                f" expected {', '.join(own.values())} of {', '.join(own)}, as in {domain.folder}"
            )
    if missing := set(domain.pomdp.actions) - set(people.pomdp.actions):
        raise DomainError(f"{name} has no action {min(missing)}, which {domain.folder} has")
    if unknown := set(people.pomdp.observations) - set(domain.pomdp.observations):
        raise DomainError(f"{name} has the observation {min(unknown)}, which {domain.folder} has not")
    for report, value in domain.planning.reports.items():
        reported, true = domain.reasoning.split(value), people.planning.reports.get(report)
        if true is None or people.reasoning.split(true) != reported:
            raise DomainError(f"{name} does not report {value} by {report}, as {domain.folder} does")


def _check_values(
    domain: Domain, people: Domain, attribute: str, name: str, kind: str, *, both: bool
) -> None:
    """Check the values of an attribute that the robot knows. both: whether the people have to have all."""
    known = people.reasoning.program.attributes
    own = set(domain.program.attributes[attribute].values)
    if attribute not in known:
        raise DomainError(f"{name} has no attribute {attribute}, which is {kind} in {domain.folder}")
    found = set(known[attribute].values)
    if found - own or (both and own - found):
        raise DomainError(
            f"{attribute}, {kind} in {domain.folder}, has the values {', '.join(sorted(own))}; in {name} it"
            f" has {', '.join(sorted(found))}"
        )


def make_channel(people: Domain, sense: str) -> NoisyChannel:
    """Return the noisy channel of a sense for people of a domain.

    Raises:
        DomainError: the domain has no such sense, or it has no noisy channel.
    """
    return NoisyChannel.from_domain(people, people.find_sense(sense))
