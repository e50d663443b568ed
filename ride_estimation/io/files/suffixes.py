# Copyright 2026 ride_estimation contributors
"""Endings of measurement files: the format by which each is read and written."""

from __future__ import annotations

#: endings that can be read
READ_SUFFIXES = (".csv", ".txt", ".tsv", ".lvm", ".parquet", ".mf4", ".mdf", ".dat", ".tdms", ".rpc", ".rsp", ".drv")
#: endings that can be written
WRITE_SUFFIXES = (".csv", ".parquet", ".mf4", ".rpc")
