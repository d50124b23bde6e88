"""Output of a domain's name, preset and description."""

from __future__ import annotations

from typing import TYPE_CHECKING

from lcorpp.cli import console

if TYPE_CHECKING:
    from lcorpp.domains import Domain


def print_domain(domain: Domain) -> None:
    """Print the name, preset and description of a domain."""
    preset = f", preset {domain.preset}" if domain.preset else ""
    console.out.print(f"{domain.name}{preset}: {domain.description}", style="bold")
