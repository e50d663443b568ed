# Copyright 2026 ride_estimation contributors
"""Durability and ride comfort of estimated signals."""
