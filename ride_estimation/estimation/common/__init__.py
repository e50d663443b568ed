# Copyright 2026 ride_estimation contributors
"""What every part of the estimator shares: measurement geometry, channel layout, settings, estimates, block arithmetic."""
