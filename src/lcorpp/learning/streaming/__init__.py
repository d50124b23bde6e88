"""Streaming classification: predictions for moving people, updated with every sample.

`resampler` orders the samples of one person and resamples them to a fixed rate, `state` keeps the classifier
state of each person, and `streaming_classifier` combines both for all people. `prefixes` applies a classifier
to the beginnings of recorded tracks, `timeline` contains and calibrates these predictions, and `plots` draws
them; `prefix_ensemble` trains a classifier for short prefixes.
"""
