# Copyright 2026 ride_estimation contributors
"""Force elements, one file each."""
