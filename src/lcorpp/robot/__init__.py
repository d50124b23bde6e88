"""The robot of `lcorpp robot`: its configuration, people who are tracked, and decisions about them."""
