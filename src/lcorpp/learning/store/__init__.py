"""The growing data set of a sense in Algorithm 1: an SQLite file of tracks that survives any crash.

`Store` appends to it, one process at a time; `read_store` reads it, any number at a time. The tables:

- `store`, one row: identity, channels and classes (JSON lists), interval (s), points (NULL if they vary, 1
  for a table of features, whose `channels` are the features), crc32;
- `track`, a row per track: record (its number), id, group_id, context and extra (JSON objects), label,
  source, belief (JSON list in the order of the classes), time (ISO 8601), trajectory (the channels one after
  the other, little-endian float64; empty if the sense perceived nothing), crc32;
- `later_label`, a row per later label: record, track (the track's record), label, source, belief, time,
  crc32.

Records are numbered from 1 across both tables. `crc32` is the CRC-32 of the row's other cells as a compact
JSON list, continued over the trajectory's bytes. SQLite's write-ahead log makes each call one durable
transaction; checksums and record numbers reveal damage that SQLite does not notice.
"""

from lcorpp.learning.store.records import SOURCES, LabelRecord, NewTrack, StoredTrack, TrackSchema
from lcorpp.learning.store.snapshot import Damage, Snapshot, is_store, read_store
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
