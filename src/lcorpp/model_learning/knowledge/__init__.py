"""Knowledge from records: which attributes depend on which, by what rules, and with which numbers."""
