# Copyright 2026 ride_estimation contributors
"""Deflection of the mounts: rigid motion of body and base, deformation of the base, tilt of brackets."""
