"""The four sections of a `domain.toml`, each with the files that it names."""
