# Copyright 2026 ride_estimation contributors
"""What every command takes, one file per verb; nothing of the work is imported here, so that help and mistakes answer at once."""
