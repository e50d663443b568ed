# Copyright 2026 ride_estimation contributors
"""The ride-estimation command, one file per verb."""
