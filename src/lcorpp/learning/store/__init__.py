"""The growing data set of Algorithm 1: a file of tracks that survives a crash at any moment.

`Store` adds to it, one process at a time; `read_store` reads it, any number at a time. The file:

- two equal lines of text, the head: `lcorpp tracks `, the CRC-32 (eight hexadecimal digits) of what follows,
  a space, the version, a space, JSON. One whole line is enough;
- frames, see `frames`: the marker that the head gives, CRC-32, lengths, JSON facts, numbers. A track's facts
  are number (of the record, from 1), id, group, label, source, belief (in the order of the head's classes),
  time, context, extra and points; its numbers are the channels one after the other. A later judgement has
  number, of (the track's id), label, source, belief and time.

SQLite and HDF5 were the alternatives: a damaged byte in their trees can cost any number of tracks, and of
the second a crash may cost all.
"""

from lcorpp.learning.store.contents import Damage
from lcorpp.learning.store.layout import TrackSchema
from lcorpp.learning.store.reading import Snapshot, is_store, read_store
from lcorpp.learning.store.tracks import SOURCES, LabelRecord, NewTrack, StoredTrack
from lcorpp.learning.store.writing import Store

__all__ = [
    "SOURCES",
    "Damage",
    "LabelRecord",
    "NewTrack",
    "Snapshot",
    "Store",
    "StoredTrack",
    "TrackSchema",
    "is_store",
    "read_store",
]
