"""Trust in a domain: its composition, and policies for the estimated observation model."""
