"""Streaming classification: predictions for moving people, updated with every sample.

`resampler` orders the samples of one person and resamples them to a fixed rate, `state` keeps the classifier
state of each person, `people_predictor` updates predictions for several people, and `streaming_classifier`
tracks all people. `prefixes` applies a classifier to the beginnings of recorded tracks, `timeline` contains
and calibrates these predictions, `prefix_sets` forms sets of them, and `plots` draws them; `prefix_ensemble`
trains a classifier for short prefixes. A `trigger` decides when enough of a track is seen.
"""
