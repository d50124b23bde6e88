"""One hypothesis profile for all tests: no test fails because the machine is slow or busy."""

import signal

from hypothesis import HealthCheck, settings

settings.register_profile("lcorpp", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("lcorpp")

# Tests interrupt themselves and their children; a shell that runs them in the background ignores the signal.
signal.signal(signal.SIGINT, signal.default_int_handler)
