"""The commands of the page: `lcorpp play` and `lcorpp export`."""
