# Copyright 2026 ride_estimation contributors
"""One stochastic model of a body on mounts on a deforming base, filter, smoother and joint estimation of its constants."""
