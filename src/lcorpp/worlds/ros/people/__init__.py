"""People as trackers and laser scanners detect them."""
