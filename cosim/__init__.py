"""How FMUs are put together, run and looked at."""
