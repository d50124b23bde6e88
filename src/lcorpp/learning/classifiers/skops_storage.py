"""Steps of other libraries in a stored classifier: kept by skops, which runs nothing when it loads.

Only types that are known to be harmless are taken back: those that skops trusts, and the few below. A tree of
scikit-learn is among them after its links have been checked, as a forged one could lead outside its memory.

Source: skops.io, "Secure persistence".
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from lcorpp.errors import DataError, expected_one_of

FOREIGN = "skops"
"""The kind of such a step, and the name of its array."""

TREE = "sklearn.tree._tree.Tree"

TRUSTED = (
    TREE,
    "aeon.classification.convolution_based._minirocket.MiniRocketClassifier",
    "aeon.transformations.collection.convolution_based._minirocket.MiniRocket",
    "lcorpp.learning.classifiers.contract.Scored",
)


def pack(name: str, step: Any, own: Sequence[str]) -> npt.NDArray[np.uint8]:
    """A trained step as bytes (n,).

    Args:
        name: what the step is called. own: the kinds that can be stored without skops, for the message.

    Raises:
        DataError: skops is not installed, or the step holds a type that would not be loaded again.
    """
    kind = type(step).__name__
    try:
        from skops import io
    except ModuleNotFoundError:
        raise DataError(
            f"step {name!r} of kind {kind} can be stored only with skops: pip install 'lcorpp[skops]';"
            f" without it {expected_one_of(own)}"
        ) from None
    try:
        content = io.dumps(step)
    except Exception as error:  # it meets anything that a stranger's classifier may hold
        raise DataError(f"step {name!r} of kind {kind} cannot be stored: {error}") from None
    unknown = [found for found in io.get_untrusted_types(data=content) if found not in TRUSTED]
    if unknown:
        raise DataError(
            f"step {name!r} of kind {kind} cannot be stored safely: it holds {', '.join(unknown[:3])},"
            " and unknown types are not loaded again"
        )
    return np.frombuffer(content, dtype=np.uint8)


def unpack(name: str, content: npt.NDArray[np.uint8]) -> Any:
    """The step that `pack` made bytes of.

    Raises:
        DataError: skops is not installed, or the bytes are no such step.
    """
    try:
        from skops import io
    except ModuleNotFoundError:
        raise DataError(f"step {name!r} was stored by skops: pip install 'lcorpp[skops]'") from None
    try:
        step = io.loads(content.tobytes(), trusted=list(TRUSTED))
    except Exception as error:  # damaged content fails in many ways
        raise DataError(f"step {name!r} cannot be loaded: {error}") from None
    for tree in _trees(step):
        _check(name, tree)
    return step


def _trees(step: Any) -> Iterable[Any]:
    """The trees that a step is made of, however deep."""
    if hasattr(step, "tree_"):
        yield step.tree_
    inner = getattr(step, "estimators_", ())
    for part in np.ravel(np.asarray(inner, dtype=object)) if len(inner) else ():
        yield from _trees(part)
    for attribute in ("classifier_", "estimator_", "estimator"):
        part = getattr(step, attribute, None)
        if part is not None:
            yield from _trees(part)


def _check(name: str, tree: Any) -> None:
    """Complain about a tree whose links lead outside or in a circle."""
    nodes = np.arange(tree.node_count)
    for children in (tree.children_left, tree.children_right):
        inner = children != -1
        if not ((children[inner] > nodes[inner]) & (children[inner] < tree.node_count)).all():
            raise DataError(f"step {name!r} cannot be loaded: a tree in it is damaged")
    split = tree.children_left != -1
    if not ((tree.feature[split] >= 0) & (tree.feature[split] < tree.n_features)).all():
        raise DataError(f"step {name!r} cannot be loaded: a tree in it is damaged")
