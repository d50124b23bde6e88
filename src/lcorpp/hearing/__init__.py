"""Measurements of the observation model of speech."""
