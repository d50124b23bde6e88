"""Sources of trust: predictors of the shared value, stated and learnt, and their weights."""
