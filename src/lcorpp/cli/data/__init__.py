"""`lcorpp data`: make, describe, draw and convert recorded data."""
