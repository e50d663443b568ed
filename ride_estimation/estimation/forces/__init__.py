# Copyright 2026 ride_estimation contributors
"""Force laws of the mounts and the force at every attachment point."""
