"""`lcorpp explain`: one decision, step by step, and the person it is about."""
