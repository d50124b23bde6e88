"""Storage of other libraries' pipeline steps by skops, which executes nothing when it loads.

Only harmless types are loaded: those that skops trusts, and those in `TRUSTED`. The trees of scikit-learn are
among them, after a check of their links, because a forged tree could address memory outside itself.

Source: skops.io, "Secure persistence".
"""

from __future__ import annotations

import io
import zipfile
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from lcorpp.archives import check_size
from lcorpp.errors import DataError, expected_one_of

SKOPS = "skops"
"""The stored kind of such a step, and the name of its array."""

TREE = "sklearn.tree._tree.Tree"

TRUSTED = (
    TREE,
    "lcorpp.learning.classifiers.forest.Forest",
    "lcorpp.learning.contract.SigmoidScores",
)

RENAMED = {
    b'"__class__": "Scored"': b'"__class__": "SigmoidScores"',
    b'"lcorpp.learning.fitting"': b'"lcorpp.learning.contract"',
}
"""Names in files written before November 2026 -> names of today."""


def dump_step(name: str, step: Any, native: Sequence[str]) -> npt.NDArray[np.uint8]:
    """Return a trained step as bytes (n,).

    Args:
        name: the name of the step. native: the kinds that need no skops, for the message.

    Raises:
        DataError: skops is not installed, or the step contains a type that could not be loaded.
    """
    kind = type(step).__name__
    try:
        from skops import io as skops_io
    except ModuleNotFoundError:
        raise DataError(
            f"step {name!r} of kind {kind} can be stored only with skops: pip install 'lcorpp[skops]';"
            f" without it {expected_one_of(native)}"
        ) from None
    try:
        content = skops_io.dumps(step)
    except Exception as error:  # a user's classifier may contain anything
        raise DataError(f"step {name!r} of kind {kind} cannot be stored: {error}") from None
    unknown = [found for found in skops_io.get_untrusted_types(data=content) if found not in TRUSTED]
    if unknown:
        raise DataError(
            f"step {name!r} of kind {kind} cannot be stored safely: it contains {', '.join(unknown[:3])},"
            " and unknown types are not loaded again"
        )
    return np.frombuffer(content, dtype=np.uint8)


def load_step(name: str, content: npt.NDArray[np.uint8]) -> Any:
    """Return the step that `dump_step` stored.

    Raises:
        DataError: skops is not installed, or the bytes are not a stored step.
    """
    try:
        from skops import io as skops_io
    except ModuleNotFoundError:
        raise DataError(f"step {name!r} was stored by skops: pip install 'lcorpp[skops]'") from None
    try:
        check_size(content.tobytes())
        step = skops_io.loads(_rename(content.tobytes()), trusted=list(TRUSTED))
    except Exception as error:  # damaged content fails in many ways
        raise DataError(f"step {name!r} cannot be loaded: {error}") from None
    for tree in _trees(step):
        _check_links(name, tree)
    return step


def _rename(content: bytes) -> bytes:
    """Replace former class names in the schema of a skops archive."""
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        schema = archive.read("schema.json")
        if not any(former in schema for former in RENAMED):
            return content
        for former, current in RENAMED.items():
            schema = schema.replace(former, current)
        buffer = io.BytesIO()
        with zipfile.ZipFile(buffer, "w") as copy:
            for entry in archive.infolist():
                copy.writestr(entry, schema if entry.filename == "schema.json" else archive.read(entry))
    return buffer.getvalue()


def _trees(step: Any) -> Iterable[Any]:
    """Yield the trees of a step, however deep."""
    if hasattr(step, "tree_"):
        yield step.tree_
    parts = [getattr(step, name, None) for name in ("classifier_", "estimator_", "estimator")]
    parts += np.ravel(np.asarray(getattr(step, "estimators_", ()), dtype=object)).tolist()
    for part in parts:
        if part is not None:
            yield from _trees(part)


def _check_links(name: str, tree: Any) -> None:
    """Raise DataError if a link of a tree leads outside it or backwards."""
    nodes, split = np.arange(tree.node_count), tree.children_left != -1
    is_valid = ((tree.feature[split] >= 0) & (tree.feature[split] < tree.n_features)).all()
    for children in (tree.children_left, tree.children_right):
        inner = children != -1
        is_valid &= ((children[inner] > nodes[inner]) & (children[inner] < tree.node_count)).all()
    if not is_valid:
        raise DataError(f"step {name!r} cannot be loaded: a tree in it is damaged")
