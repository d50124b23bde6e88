"""
Plain statements and numbers in .pomdp text, for `tokens.py`. `make stubs` generates the stub.
"""

import numpy
from numpy.typing import NDArray


class Names:
    def __init__(self, indices: dict[str, int]) -> None: ...

def scan_statements(text: object, offset: int, actions: Names, states: Names, observations: Names, n_states: int, n_observations: int, reward_references: int, max_probability: float, max_numbers: int) -> tuple[int, tuple[NDArray[numpy.int32], NDArray[numpy.float64], NDArray[numpy.int64], NDArray[numpy.int32], NDArray[numpy.int64], NDArray[numpy.int64], NDArray[numpy.int32], NDArray[numpy.float64]], tuple[NDArray[numpy.int32], NDArray[numpy.float64], NDArray[numpy.int64], NDArray[numpy.int32], NDArray[numpy.int64], NDArray[numpy.int64], NDArray[numpy.int32], NDArray[numpy.float64]], tuple[NDArray[numpy.int32], NDArray[numpy.float64], NDArray[numpy.int64], NDArray[numpy.int32], NDArray[numpy.int64], NDArray[numpy.int64], NDArray[numpy.int32], NDArray[numpy.float64]]]: ...

def scan_rows(text: object, offset: int, rows: int, count: int) -> object: ...
