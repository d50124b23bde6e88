"""Settings of all tests: no test fails because the machine is slow or busy, or uses the cache of policies."""

import os
import signal

from hypothesis import HealthCheck, settings

settings.register_profile("lcorpp", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("lcorpp")

# Tests interrupt themselves and their children; a shell that runs them in the background ignores the signal.
signal.signal(signal.SIGINT, signal.default_int_handler)

os.environ["LCORPP_CACHE"] = ""  # of the tests' child processes, too; tests of the cache set another folder
