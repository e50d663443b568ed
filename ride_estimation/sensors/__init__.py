# Copyright 2026 ride_estimation contributors
"""Sensor layouts and the accelerometer model."""
