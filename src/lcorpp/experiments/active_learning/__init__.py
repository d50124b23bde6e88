"""Algorithm 1 on simulated people: the senses that learn, the batches and the store of a run."""
