"""The paper's figures, one file each; a function draws one from the results of an experiment."""
