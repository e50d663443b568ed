# Copyright 2026 ride_estimation contributors
"""What the simulation gets wrong: residuals, causes, ranking, gain."""
