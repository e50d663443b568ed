# Copyright 2026 ride_estimation contributors
"""One run: its data, what the model does on it, how noisy a right model would be, and the view of all three."""
