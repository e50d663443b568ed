# Copyright 2026 ride_estimation contributors
"""Roads, bumps, wheelbase delay, engine order, chirps."""
