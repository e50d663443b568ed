# Copyright 2026 ride_estimation contributors
"""The Python interface: one function per job, the same work as the command of that name. The package itself names them."""
