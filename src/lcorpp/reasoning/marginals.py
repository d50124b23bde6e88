"""The distributions of all terms at once, see `Reasoner.posteriors`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from lcorpp.errors import ProgramError, UndefinedError, check_type
from lcorpp.reasoning.answers import format_conditions, make_no_world_error
from lcorpp.reasoning.resolve import resolve_labels
from lcorpp.values import Distribution

if TYPE_CHECKING:
    from lcorpp.reasoning.circuit.circuit import Circuit
    from lcorpp.reasoning.language.program import Program
    from lcorpp.values import Label


def compute_marginals(
    program: Program,
    evidence: Mapping[str, Label] | Sequence[Mapping[str, Label]],
    compile_all: Callable[[tuple[str, ...]], Circuit],
) -> dict[str, Distribution] | list[dict[str, Distribution]]:
    """Compute the posteriors of the terms that have a value in all worlds with the evidence.

    Args:
        compile_all: returns the circuit for all terms given some.

    Raises:
        ProgramError, UndefinedError, TooLargeError: as `Reasoner.compile`, or as a call of a circuit.
    """
    check_type(evidence, (Mapping, Sequence), "evidence", ProgramError)
    rows = [evidence] if isinstance(evidence, Mapping) else list(evidence)
    resolved = [resolve_labels(program, row) for row in rows]
    given: list[dict[str, Label]] = [{**facts, **likelihoods} for facts, likelihoods in resolved]
    names = tuple(sorted({name for row in given for name in row}))
    circuit = compile_all(names)
    encoded, _ = circuit.encoder.encode({name: [row.get(name) for row in given] for name in names})
    probabilities = circuit.compute_probabilities(encoded)
    found: list[dict[str, Distribution]] = [{} for _ in encoded.codes]
    for query, shares in probabilities.items():
        if len(impossible := np.flatnonzero(np.isnan(shares[:, 0]))):
            if len(rows) == 1:
                raise make_no_world_error(program, format_conditions(given[0], {}))
            raise UndefinedError(f"{program.file}: row {impossible[0]}: no possible world has this evidence")
        shares.flags.writeable = False
        for row in np.flatnonzero(shares[:, -1] == 0).tolist():
            found[row][query] = Distribution.unchecked(circuit.values[query], shares[row, :-1])
    if not names:  # no column, so that there is one row
        found = [dict(found[0]) for _ in rows]
    return found[0] if isinstance(evidence, Mapping) else found
