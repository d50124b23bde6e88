"""Simulated people: a population drawn from a P-log program, their trajectories, and worlds to act in."""
