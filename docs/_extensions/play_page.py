"""The page of `lcorpp export`, written into the built site as `play/index.html`."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

FOLDER = "play"
DOMAIN = "intention"


def _write_page(app: Any, error: Exception | None) -> None:
    if error is None and app.builder.format == "html":
        code = "from lcorpp.cli.main import main; main()"
        arguments = ["export", DOMAIN, "--to", str(Path(app.outdir) / FOLDER)]
        subprocess.run([sys.executable, "-c", code, *arguments], check=True, stdout=subprocess.DEVNULL)


def setup(app: Any) -> dict[str, Any]:
    """Connect to Sphinx."""
    app.connect("build-finished", _write_page)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
