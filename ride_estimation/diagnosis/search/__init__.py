# Copyright 2026 ride_estimation contributors
"""From score tests to a set of causes."""
