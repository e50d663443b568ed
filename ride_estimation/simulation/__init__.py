# Copyright 2026 ride_estimation contributors
"""Integrators and field runs with known truth."""
