"""Options of the commands: shared ones, those of one decision, of classifiers and of recorded data."""
