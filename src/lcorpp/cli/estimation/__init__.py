"""Commands that estimate: numbers of a program, and models."""
