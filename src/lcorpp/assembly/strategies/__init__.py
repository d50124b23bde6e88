"""Strategies beside the table of the paper: baselines of lcorpp, and the user's own."""
