"""Work units: a pure function of many values, in processes or on a cluster, with results that outlast a crash."""
