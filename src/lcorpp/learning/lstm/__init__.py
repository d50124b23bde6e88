"""The paper's classifier, an LSTM over motion: its weights, the network they make, two ways to train it."""

from lcorpp.learning.lstm.classifier import LstmClassifier
from lcorpp.learning.lstm.state import LstmState

__all__ = ["LstmClassifier", "LstmState"]
