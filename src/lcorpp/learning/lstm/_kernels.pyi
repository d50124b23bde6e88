"""The C++ kernels of the LSTM, built from native/; `network` and `training` tell what each does."""

import numpy as np
import numpy.typing as npt

from lcorpp.values import Array

_Floats = npt.NDArray[np.float32]

def levels() -> list[str]: ...

class Network:
    def __init__(
        self,
        inputs: _Floats,
        recurrent: _Floats,
        bias: _Floats,
        dense: _Floats,
        dense_bias: _Floats,
        level: str | None = None,
    ) -> None: ...
    def scores(self, tracks: _Floats, /) -> _Floats: ...
    def step(self, hidden: _Floats, cell: _Floats, points: _Floats) -> _Floats: ...

class Trainer:
    def __init__(
        self,
        inputs: _Floats,
        recurrent: _Floats,
        bias: _Floats,
        dense: _Floats,
        dense_bias: _Floats,
        tracks: _Floats,
        targets: npt.NDArray[np.int32],
        weights: _Floats,
        batch: int,
        keep: float,
        level: str | None = None,
    ) -> None: ...
    def epoch(self, order: npt.NDArray[np.int64], kept: npt.NDArray[np.bool_], rates: Array, /) -> None: ...
    def weights(self) -> tuple[_Floats, _Floats, _Floats, _Floats, _Floats]: ...
