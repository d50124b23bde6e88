"""Thin commands: read, call, write, print."""
