"""From a program to a circuit: walk through its states once, then multiply out all that was not asked for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from lcorpp.errors import ProgramError
from lcorpp.reasoning.circuit.circuit import Circuit
from lcorpp.reasoning.circuit.matrices import Layer, layered
from lcorpp.reasoning.circuit.plan import plan
from lcorpp.reasoning.circuit.trellis import Trellis, trellis
from lcorpp.reasoning.circuit.world_queries import Paths
from lcorpp.reasoning.gc_pause import without_collection
from lcorpp.reasoning.language.arithmetic import ground
from lcorpp.reasoning.language.program import Program
from lcorpp.reasoning.resolve import interventions_of, term_of, terms_of
from lcorpp.values import Array


@without_collection()
def compiled(
    program: Program, inputs: Sequence[str], query: str | Sequence[str], do: Mapping[str, str]
) -> Circuit:
    """Compile a program.

    Args:
        inputs: the terms that evidence may name; an attribute with arguments stands for all its terms.
        query: a term, or several.
        do: interventions, term -> value.

    Raises:
        ProgramError: a name is unknown, a world breaks a condition of the language, or there are cr-rules.
        TooLargeError: the program has too many states.
    """
    if program.has_cr_rules:
        raise ProgramError(
            f"{program.file}: a program with cr-rules cannot be compiled: an observation may create worlds;"
            " ask for one posterior at a time"
        )
    names = list(dict.fromkeys(found for name in inputs for found in terms_of(program, name)))
    queries = ground(term_of(program, query)) if isinstance(query, str) else [
        ground(term_of(program, name)) for name in query
    ]  # fmt: skip
    do = interventions_of(program, do)
    observed = dict.fromkeys((*names, *((queries,) if isinstance(queries, str) else queries)))
    built: Trellis = trellis(plan(program, do, wanted=observed))
    layers, ending = labelled_layers(built, list(observed))
    circuit = Circuit(program, names, queries, do, layers, ending, Paths(built))
    circuit.prepare()
    return circuit


def labelled_layers(built: Trellis, names: Sequence[str]) -> tuple[list[Layer], Array]:
    """The layers for some terms; a term that no rule speaks of never has a value, which is a layer too."""
    index = built.plan.index
    labels = {index[name]: i for i, name in enumerate(names) if name in index}
    layers, ending = layered(built, labels)
    missing = [i for i, name in enumerate(names) if name not in index]
    never = [
        Layer.never(i, len(built.plan.ground.program.attributes[names[i].partition("(")[0]].values))
        for i in missing
    ]
    return [*never, *layers], ending
