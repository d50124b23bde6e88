"""Knowledge from records: the structure, the rules and their numbers, written as a P-log program."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from lcorpp.errors import DataError
from lcorpp.fitting import Fit, SoftRecord, fit
from lcorpp.model_learning.knowledge.cases import PSEUDO_RECORDS, Cases, quote_record
from lcorpp.model_learning.knowledge.networks import Network, learn_network
from lcorpp.model_learning.knowledge.order import find_pairs
from lcorpp.model_learning.knowledge.program import Rules, list_atoms, list_declarations
from lcorpp.model_learning.knowledge.rules import Rule, find_rules
from lcorpp.model_learning.knowledge.structures import average_edges
from lcorpp.reasoning import Program, parse_plog
from lcorpp.reasoning.quoting import make_name_text, make_value_text
from lcorpp.values import Array

FILE = "knowledge.plog"
"""Name of the file of a learnt program."""


@dataclass(frozen=True, eq=False)
class Knowledge:
    """A program with what it was learnt from.

    edges: (n, n) the probability of each edge, averaged over all structures.
    rules: of each attribute. fitted: the numbers of the program with their intervals.
    """

    cases: Cases
    network: Network
    edges: Array
    rules: tuple[tuple[Rule, ...], ...]
    fitted: Fit

    def __repr__(self) -> str:
        n_rules = sum(map(len, self.rules))
        return (
            f"<Knowledge: {len(self.cases.names)} attributes, {n_rules} rules, {self.cases.count:g} records>"
        )

    @property
    def program(self) -> Program:
        """The program."""
        return self.fitted.program

    @property
    def structure(self) -> dict[str, tuple[str, ...]]:
        """Attribute -> those it depends on."""
        names = self.cases.names
        return {name: tuple(names[i] for i in self.list_parents(j)) for j, name in enumerate(names)}

    def list_parents(self, attribute: int) -> list[int]:
        """Return the attributes on which the rules of one depend; a parent may be in no rule."""
        return sorted({i for rule in self.rules[attribute] for i in rule.context})


def learn_knowledge(
    records: Iterable[Mapping[str, str] | SoftRecord],
    *,
    hidden: Mapping[str, Sequence[str]] | None = None,
    order: Sequence[str] = (),
    values: Mapping[str, Sequence[str]] | None = None,
    seed: int = 0,
    progress: Callable[[float], None] = lambda _share: None,
) -> Knowledge:
    """Learn a program from records: which attributes depend on which, by what rules, with which numbers.

    The structure is the most probable one (BDeu score) among all acyclic ones; of several that imply the same
    independences, edges go from earlier attributes to later ones. Values that the data do not distinguish
    share a rule. The numbers maximise the posterior density, with one record of equal values for each rule
    before the data.

    Args:
        records: attribute -> value, with at most 12 attributes of two or more values; what is missing is
            unknown. A `SoftRecord` has likelihoods of some values.
        hidden: attributes that no record states -> their values; their effects are learnt by
            expectation-maximisation.
        order: texts such as ``identity < time, location``: no attribute depends on one after it.
        values: attributes -> their values in order; of others, those that occur, sorted.
        seed: of the random starts with hidden attributes.
        progress: takes the completed share of the work.

    Raises:
        DataError: there are no records or too many attributes or unknown values, or a name in `order` or
            `hidden` does not fit.

    Examples:
        >>> from lcorpp.model_learning import learn_knowledge
        >>> sun, rain = {"weather": "sun", "umbrella": "no"}, {"weather": "rain", "umbrella": "yes"}
        >>> knowledge = learn_knowledge(30 * [sun] + 10 * [rain], order=["weather < umbrella"])
        >>> knowledge.structure
        {'weather': (), 'umbrella': ('weather',)}
        >>> round(float(knowledge.edges[0, 1]), 3)
        1.0
    """
    own = [quote_record(record) for record in records]
    hidden, values = (
        {make_name_text(name): tuple(map(make_value_text, names)) for name, names in (given or {}).items()}
        for given in (hidden, values)
    )
    cases = Cases.of(own, hidden=hidden, values=values)
    pairs = find_pairs(order, cases.names, cases.constants)
    rng = np.random.default_rng(seed)
    network = learn_network(cases, pairs, rng, lambda share: progress(0.8 * share))
    edges = average_edges(network.scores, pairs)
    rules = tuple(
        tuple(find_rules(cases, network.weights, j, parents)) for j, parents in enumerate(network.parents)
    )
    equal, begin = (_make_program(cases, rules, estimated=estimated) for estimated in (False, True))
    fitted = fit(equal, own, prior=PSEUDO_RECORDS, begin=begin)
    progress(1.0)
    return Knowledge(cases, network, edges, rules, fitted)


def check_attributes(
    stated: Iterable[str], hidden: Mapping[str, Sequence[str]] | None, order: Sequence[str]
) -> None:
    """Check hidden attributes and an order before records are made, which may take long.

    Args:
        stated: names of the attributes of the records.

    Raises:
        DataError: a hidden attribute is stated, or the order has an unknown name or a circle.
    """
    names = [*map(make_name_text, stated)]
    for name in hidden or ():
        if make_name_text(name) in names:
            raise DataError(f"the hidden attribute {name} is one of those that are stated; expected another")
    find_pairs(order, [*names, *map(make_name_text, hidden or ())])


def _make_program(cases: Cases, rules: Rules, *, estimated: bool) -> Program:
    """Return the program with equal numbers, or with those that follow from the counts."""
    lines = list(list_declarations(cases))
    for atom in list_atoms(cases, rules):
        number = f"1/{cases.sizes[atom.attribute]}"
        if estimated:
            smoothed = atom.rule.counts + PSEUDO_RECORDS / cases.sizes[atom.attribute]
            number = f"{smoothed[atom.value] / smoothed.sum():.12f}"
        lines.append(f"{atom.left_side} = {number}.")
    return parse_plog("\n".join(lines), file=FILE)
