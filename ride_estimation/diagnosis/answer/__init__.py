# Copyright 2026 ride_estimation contributors
"""What a diagnosis says: names, confidence, gain, stability, and what to drive next."""
