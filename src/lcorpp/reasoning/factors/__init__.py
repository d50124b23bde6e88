"""Programs whose terms are tables: `factor_graph` finds the tables, `network` sums their products.

The sums are computed in C++ along an elimination order (`native/tables`); `exact` computes them in fractions.
"""
