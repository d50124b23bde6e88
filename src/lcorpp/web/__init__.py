"""The page on which a person plays with a robot: its engine behind a WebSocket, and its static export."""
