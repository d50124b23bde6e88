"""The paper's LSTM: network and weights, training by compiled kernels or torch, and the classifier."""

from lcorpp.learning.lstm.classifier import LstmClassifier, LstmState

__all__ = ["LstmClassifier", "LstmState"]
