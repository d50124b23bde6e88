"""Numbers from data: maximum-likelihood estimates of the numbers of pr-atoms."""
