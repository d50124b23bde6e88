"""
Sums of products of tables, for `network.py`. `make stubs` generates the stub.
"""

from collections.abc import Sequence
from typing import Annotated

import numpy
from numpy.typing import NDArray


class Plan:
    """The steps that answer one kind of question."""

    @property
    def cost(self) -> float:
        """Multiplications, about."""

    @property
    def width(self) -> float:
        """Bits of the largest clique."""

    @property
    def memory(self) -> float:
        """Bytes of all messages."""

    @property
    def order(self) -> list[int]:
        """The variables that are summed out."""

    @property
    def tables(self) -> list[int]:
        """The tables that are read."""

    def evaluate(self, values: NDArray[numpy.int64], weights: NDArray[numpy.float64]) -> tuple[NDArray[numpy.float64], NDArray[numpy.float64]]:
        """
        Compute weights and the logarithms of their scales, for each row of evidence: values of the observed
        variables, and weights of the values of the weighted ones.
        """

    def distribute(self, values: Sequence[int]) -> NDArray[numpy.float64] | None:
        """
        Compute the joint distribution given one value of each observed variable; None if they are impossible.
        """

class Network:
    """Tables over variables."""

    def __init__(self, sizes: Sequence[int], scopes: Sequence[Sequence[int]], tables: Sequence[Annotated[NDArray[numpy.float64], dict(order='C', device='cpu', writable=False)]], children: Sequence[int]) -> None:
        """
        Args:
            sizes: of the variables.
            scopes: the variables of each table, the last one fastest.
            tables: float64 arrays.
            children: the variable whose distribution each table is, -1 for other tables.
        """

    def plan(self, kept: Sequence[int], observed: Sequence[int], weighted: Sequence[int], marginals: bool = False) -> Plan:
        """
        Plan how to compute the joint weights of the kept variables, or of every variable apart.
        """
