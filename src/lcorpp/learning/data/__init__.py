"""Recorded motion: read, repair on request, describe, plot, and convert to a `Dataset`.

tracks          Track, Recording and Repair: tracks of unequal length, as they were read
reading         read any format, detected by content
csv_reader      CSV text in columns, errors located         formats      each format, and its detection
npz, authors, labels                                        data sets, the authors' files, files of labels
measures        units that the caller gives                 times        units of time that are asked for
ingest          rows of any format -> tracks: it collects the rows of each id, cleaning splits and checks
                them and detects millimetres, repairs lists the faults that may be repaired
windows         tracks -> a Dataset of a fixed interval     dataset      check and split a Dataset
writing         Recording -> CSV or Parquet                 describe     counts, durations, speeds, duplicates
fetching        downloads with checksums                    plots        figures, with matplotlib
"""
