"""Policy evaluation: exact values over reachable beliefs, simulation, certificates and policy graphs.

policy_evaluation  bounds on a policy's value             certificate   check of a solver's claims
simulation         Monte Carlo rollouts                   policy_graph  a policy as a finite-state controller
belief_graph       reachable beliefs, each computed once  occupancy     discounted visits of the beliefs

batch_policy, sparse_beliefs, rollout, sampling, control_variates and mdp are their parts.
"""
