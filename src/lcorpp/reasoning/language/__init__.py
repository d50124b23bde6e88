"""Text to syntax tree to checks: both dialects of P-log and the shorthand of the paper, in one language."""
