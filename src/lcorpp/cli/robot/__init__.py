"""Commands of a robot, and of what it sees and hears."""
