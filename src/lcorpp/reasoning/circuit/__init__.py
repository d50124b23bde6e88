"""Compiled programs: `Circuit` answers one kind of question for new evidence.

`compiler` chooses between the layers of a decision diagram (`diagram`) and tables (`factors`).
"""
