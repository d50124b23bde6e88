"""`lcorpp data`, and the options about data and the classifiers that learn from them."""
