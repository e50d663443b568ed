# Copyright 2026 ride_estimation contributors
"""Online estimation, one sample at a time."""
