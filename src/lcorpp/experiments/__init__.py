"""The paper's experiments: simulated people, trials, exact values, intervals and figures."""
