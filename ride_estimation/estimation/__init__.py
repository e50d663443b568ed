# Copyright 2026 ride_estimation contributors
"""Online estimation, one sample at a time; README.md in this folder is the map."""
