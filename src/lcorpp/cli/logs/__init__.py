"""Commands that read a log of decisions."""
