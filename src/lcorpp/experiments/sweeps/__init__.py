"""Sweeps: the scores of strategies in many variants of a domain."""
