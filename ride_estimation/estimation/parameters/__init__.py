# Copyright 2026 ride_estimation contributors
"""Recursive estimation of stiffness, damping and, where it is observable, mass."""
