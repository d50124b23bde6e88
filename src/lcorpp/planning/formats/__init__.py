"""The files of planning: models and policies, read and written, each format in files of its own."""
