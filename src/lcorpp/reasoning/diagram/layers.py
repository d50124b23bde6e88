"""Compilation, step 4: the layers of an arithmetic circuit, and the passes that answer questions.

Let t1, ..., tn be the terms that evidence may name or a query may read; all other terms are summed out. The
circuit has a layer for each of them, and where independent branches meet. The inputs of a layer are products
of outputs of the layers before it: one factor for each branch. Each output is a sum of entries: a weight, an
outcome of the term, which is weighed by the evidence about it (1 or 0, or its likelihood; 1 without
evidence), and an input. So for a chain the probability of t1=v1, ..., tn=vn is a product of matrices, one for
each layer. An upward pass computes the weight of the evidence, a downward pass its joint weights with each
outcome of the queried terms: the derivatives with respect to the weights of the outcomes. Numbers are scaled
after each layer; if digits may be lost, the passes are repeated with numbers that do not underflow. All is
done in C++ (`_diagram`).

Source: Darwiche, "A differential approach to inference in Bayesian networks", J. ACM 50(3), 2003; likelihoods
in place of indicators, Pearl, Probabilistic Reasoning in Intelligent Systems, 1988, section 2.2.2.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING

from lcorpp.errors import TooLargeError
from lcorpp.reasoning._diagram import Layers
from lcorpp.reasoning.diagram.decision_diagram import MAX_BYTES, DecisionDiagram

if TYPE_CHECKING:  # one question without other evidence needs no numpy
    from lcorpp.reasoning.evidence import EncodedEvidence
    from lcorpp.values import Array

MIN_FLOAT = 1e-300
"""Smaller probabilities are converted to a number and a power of 2."""


def build_layers(
    diagram: DecisionDiagram, names: Iterable[str], evidence: Mapping[str, str] | None = None
) -> Layers:
    """Build the layers for the observed terms, in the order of their variables.

    Args:
        evidence: term -> value, that is the same for all questions.

    Raises:
        TooLargeError: the layers take more memory than `MAX_BYTES`.
    """
    system, graph = diagram.system, diagram.graph
    step_of = {term: step for step, terms in enumerate(system.tree.order) for term in terms}
    labels_of: dict[int, list[int]] = {}

    def list_outcomes(term: int) -> tuple[int, list[int], list[int]]:
        """List the step of a term, the labels of its arcs, and the outcome of the term for each."""
        step = step_of[term]
        if step not in labels_of:
            labels_of[step] = graph.list_labels(step)
        place = system.tree.order[step].index(term)
        return step, labels_of[step], [diagram.outcomes[label].values[place] for label in labels_of[step]]

    observed = []
    for variable, name in enumerate(names):
        term = system.term_numbers[name]
        step, labels, codes = list_outcomes(term)
        observed.append((step, variable, len(system.program.values[term]) + 1, labels, codes))
    selected: dict[int, list[int]] = {}
    for name, value in (evidence or {}).items():
        term = system.term_numbers[name]
        step, labels, codes = list_outcomes(term)
        wanted = system.program.values[term].index(value)
        agreeing = [label for label, code in zip(labels, codes, strict=True) if code == wanted]
        selected[step] = sorted({*agreeing}.intersection(selected.get(step, agreeing)))
    weights, exponents = _convert([outcome.weight for outcome in diagram.outcomes])
    layers = graph.build_layers(weights, exponents, observed, list(selected.items()), MAX_BYTES)
    if layers is None:
        file = system.program.source.file
        raise TooLargeError(f"{file}: more than {MAX_BYTES / 2**20:.4g} MiB in the layers of the circuit")
    return layers


def _convert(probabilities: Sequence[Fraction]) -> tuple[list[float], list[int]]:
    """Convert fractions to floating point; to numbers and powers of 2 if some of them are tiny."""
    own = {id(p): p for p in probabilities}  # outcomes share their fractions
    floats = {key: float(p) for key, p in own.items()}
    exponents = []
    if any(p and floats[key] < MIN_FLOAT for key, p in own.items()):
        shifts = {key: p.denominator.bit_length() - p.numerator.bit_length() for key, p in own.items()}
        floats = {key: float(p * 2 ** shifts[key]) for key, p in own.items()}
        exponents = [-shifts[id(p)] for p in probabilities]
    return [floats[id(p)] for p in probabilities], exponents


def weigh(
    layers: Layers, evidence: EncodedEvidence, queries: Sequence[int]
) -> tuple[dict[int, Array], Array]:
    """Compute the joint weights of the evidence and each outcome of the queried terms.

    Args:
        evidence: of the observed terms.
        queries: the variables of queried terms.

    Returns:
        (variable -> (B, outcomes) weights, (B,) the logarithms of the weights of the evidence). Only the
        ratios within a row matter. A row is 0 only for impossible evidence.
    """
    import numpy as np

    codes = np.ascontiguousarray(evidence.codes, dtype=np.int64)
    columns = [(i, np.ascontiguousarray(own, dtype=np.float64)) for i, own in evidence.weights.items()]
    distinct = list(dict.fromkeys(queries))
    found, logarithms = layers.weigh(codes, columns, distinct)
    return dict(zip(distinct, found, strict=True)), logarithms
