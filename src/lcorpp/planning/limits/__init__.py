"""Limits: policies that keep expected costs and probabilities of events below bounds, with certificates.

limit              what is limited, also as text        limited_model  what the limits count, in the states
column_generation  the search, by a linear program      solver         `solve_limited`
randomised_policy  a controller with drawn start nodes  verification   the check of a policy, forward

controller, extraction, mixture and grid_bound are parts of the search.
"""
