"""Formats of recordings: recognised by their content, and read as rows of one kind.

columns       names of columns: those of the long format, and names that other files use for them
sample        the first rows of a text file, as cells and numbers
layouts       the table of formats of rows: what their columns mean, and how each is recognised
boxes         rows of boxes in images: Stanford Drone Dataset and MOTChallenge
rows          rows of a layout -> tracks
marker_table  a row for each moment, with columns for each marker (motion capture)
json_tracks   TrajNet++ and JRDB
time_series   .ts files of labelled time series
table         tables of features                 parquet   Parquet with the columns of either
detection     the format of a file
"""
