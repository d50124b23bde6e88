"""Scores of strategies, by simulated trials and exactly."""
