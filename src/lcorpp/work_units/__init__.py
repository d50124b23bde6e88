"""Work units: a pure function of many values, in processes or on a cluster; results outlast a crash."""
