# Copyright 2026 ride_estimation contributors
"""What may be adjusted within its tolerance before anything is called a discrepancy."""
