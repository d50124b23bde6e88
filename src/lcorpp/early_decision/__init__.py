"""Early decisions: `watch` as an action, so that the policy decides when enough of a track is seen."""
