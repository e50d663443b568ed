# Copyright 2026 ride_estimation contributors
"""Motion of the body at its centre of gravity, its covariance, and the inertial loads."""
