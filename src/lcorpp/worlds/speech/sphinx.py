"""Import of pocketsphinx, an optional package, and its English model."""

from __future__ import annotations

from typing import Any

from lcorpp.errors import ActionFailedError


def load_pocketsphinx() -> Any:
    """Return the module.

    Raises:
        ActionFailedError: it is not installed.
    """
    try:
        import pocketsphinx
    except ImportError:
        raise ActionFailedError("speech needs pocketsphinx: pip install 'lcorpp[speech]'") from None
    return pocketsphinx


def find_model(name: str) -> str:
    """Return the path of a file of the English model, e.g. ``cmudict-en-us.dict``."""
    return str(load_pocketsphinx().get_model_path(f"en-us/{name}"))
