"""
Decision diagrams and the layers of circuits. `make stubs` generates the stub.

Bits are in bytes, 8 for each word.
"""

from collections.abc import Sequence
from typing import Annotated

import numpy
from numpy.typing import NDArray


class CompiledTransition:
    """The outcomes of a step and their effect on the state."""

    def __init__(self, n_words: int, input_mask: bytes, live_masks: Sequence[bytes], absorptions: Sequence[tuple[bytes, bytes]]) -> None: ...

    def add_closure(self, closed: Sequence[tuple[int, int, int]], added: Sequence[tuple[int, int, int]], targets: Sequence[tuple[int, int, int]], contradiction: int, n_atoms: int, goals: Sequence[Sequence[tuple[int, int]]]) -> None:
        """Add a closure, see `Closure`; implications have numbers of bits."""

    def add_effect(self, sets: bytes, forbids: bytes, moves: bytes, targets: bytes) -> int:
        """Add an effect; return its number. targets: of each bit of `moves`."""

    def add_choices(self, inputs: bytes, choices: Sequence[tuple[int, int]]) -> None:
        """
        Add the pairs (effect, label) of the outcomes in a state of the input bits.
        """

    def advance(self, state: bytes, effect: int) -> bytes | None:
        """
        Compute the state after an outcome, for all branches; None if it is impossible.
        """

class Layers:
    """The layers of an arithmetic circuit."""

    def __init__(self, stored: Sequence[tuple[int, tuple[int, int, int], Sequence[tuple[int, Annotated[NDArray[numpy.int64], dict(shape=(None,), order='C', device='cpu', writable=False)]]], Annotated[NDArray[numpy.int64], dict(shape=(None,), order='C', device='cpu', writable=False)], Annotated[NDArray[numpy.int64], dict(shape=(None,), order='C', device='cpu', writable=False)], Annotated[NDArray[numpy.int64], dict(shape=(None,), order='C', device='cpu', writable=False)], Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], Annotated[NDArray[numpy.int64], dict(shape=(None,), order='C', device='cpu', writable=False)]]]) -> None:
        """Raises ValueError if the layers do not fit."""

    def __len__(self) -> int: ...

    def __reduce__(self) -> tuple[object, ...]: ...

    def store(self) -> list[tuple[object, ...]]:
        """Return the layers as arrays."""

    def weigh_outcomes(self, query: int) -> list[float]:
        """
        Compute the weight of each outcome of a term without evidence; only the ratios matter.
        """

    def weigh(self, codes: NDArray[numpy.int64], columns: Sequence[tuple[int, NDArray[numpy.float64]]], queries: Sequence[int]) -> tuple[list[NDArray[numpy.float64]], NDArray[numpy.float64]]:
        """
        Compute (B, outcomes) joint weights of the evidence and each outcome of the queried terms, scaled to a maximum
        of 1, and (B,) the logarithms of the weights of the evidence.

        Args:
            codes: (B, terms) the outcome of each term, -1 for no evidence; or a row of the weights of the term.
            columns: the weights (labels, outcomes) of terms.
        """

def improve_order(bits: Sequence[float], needs: Sequence[Sequence[int]], groups: Sequence[tuple[int, Sequence[Sequence[int]]]], recursions: Sequence[Sequence[tuple[Sequence[int], int, int]]], order: Sequence[int], max_work: float) -> tuple[list[int], float, float]:
    """
    Improve an order of steps; return it, and the estimates (logarithms of the number of states) before and after. The
    result depends on the arguments only.

    Args:
        bits: of the outcomes of each step.
        needs: the steps that must come before each.
        groups: (step, -1 for constraints; the steps of each body) of rules with the same head.
        recursions: (steps of the inputs, atom of the body or -1, atom of the head or -1) of each rule.
        max_work: the number of steps and literals that the search visits.
    """

class Diagram:
    """The arcs of a decision diagram."""

    def __init__(self, children: Sequence[Sequence[int]], roots: Sequence[int], n_words: int, is_consistent: bool) -> None: ...

    def enter(self, transition: CompiledTransition, is_shared: bool) -> list[bytes]:
        """
        Enter the next step; return the states of its input bits that have no choices yet.
        """

    def expand(self, max_bytes: int) -> bool:
        """
        Expand the step that was entered; return whether the diagram is within the limit.
        """

    def prune(self) -> None:
        """Drop nodes without a world, and those that no arc reaches."""

    @property
    def has_dead_ends(self) -> bool:
        """Whether a node has no arcs."""

    @property
    def n_arcs(self) -> int:
        """The number of arcs."""

    @property
    def sizes(self) -> list[int]:
        """The number of nodes of each step."""

    def list_arcs(self, step: int) -> tuple[list[int], list[list[int]], list[int]]:
        """
        List the sources, targets in each branch and labels of the arcs of a step.
        """

    def list_labels(self, step: int) -> list[int]:
        """List the different labels of the arcs of a step, sorted."""

    def build_layers(self, weights: Sequence[float], exponents: Sequence[int], observed: Sequence[tuple[int, int, int, Sequence[int], Sequence[int]]], selections: Sequence[tuple[int, Sequence[int]]], max_bytes: int) -> Layers | None:
        """
        Sum out all terms but the observed ones; return None if the layers take more memory.

        Args:
            weights: of the labels of arcs; exponents: of 2, by which they are multiplied; may be empty.
            observed: (step, variable, number of outcomes, sorted labels, the outcome for each label).
            selections: (step, sorted labels of the arcs that worlds may have).
        """
