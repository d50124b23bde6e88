"""Recorded motion: read, repaired on request, described and drawn, and made into a `Dataset`.

tracks      what is read: tracks of unequal length     rows        CSV text in columns, mistakes located
atc, long_csv, parquet                                 the formats
repair      what may be wrong with a track             units       millimetres taken for metres
reading     any of the formats, known by its content   windows     tracks -> a rectangular Dataset
rectangular Dataset <-> .npz and Recording             writing     Recording -> CSV or Parquet
describe    counts, durations, speeds, duplicates      fetching    downloads that go on where they were cut
plots       pictures; it loads matplotlib and is imported by nothing else here
"""
