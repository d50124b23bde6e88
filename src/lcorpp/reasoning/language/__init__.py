"""The P-log language: text -> tokens -> syntax tree -> plain statements -> checked program."""
