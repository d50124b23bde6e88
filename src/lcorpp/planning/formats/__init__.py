"""File formats of models and policies: one module or package for each format."""
