"""Bayesian networks as programs: `bif` reads their files into a `bayesian_network.BayesianNetwork`."""
