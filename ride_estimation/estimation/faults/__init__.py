# Copyright 2026 ride_estimation contributors
"""Fault detection and isolation of sensors, and the health report."""
