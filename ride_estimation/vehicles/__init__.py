# Copyright 2026 ride_estimation contributors
"""Assembly of bodies, points and elements into vehicle models."""
