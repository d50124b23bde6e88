"""Commands of speech: listen to an answer, measure the observation model."""
