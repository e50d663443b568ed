# Copyright 2026 ride_estimation contributors
"""Bags, vehicle files, measurement files, results."""
