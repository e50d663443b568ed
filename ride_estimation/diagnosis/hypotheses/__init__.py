# Copyright 2026 ride_estimation contributors
"""What a candidate explanation is, and the parts that causes are built from."""
