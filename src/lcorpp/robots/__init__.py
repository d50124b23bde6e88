"""Worlds to act in that are not simulated."""

from lcorpp.robots.console import ConsoleWorld

__all__ = ["ConsoleWorld"]
