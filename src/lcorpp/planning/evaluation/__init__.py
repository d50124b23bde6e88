"""A policy followed through the beliefs it meets: what simulation, evaluation and controllers share."""
