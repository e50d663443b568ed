# Copyright 2026 ride_estimation contributors
"""Endings of measurement files: the format by which each is read and written."""

from __future__ import annotations

#: endings of RPC III: any, a response, a drive
RPC_SUFFIXES = (".rpc", ".rsp", ".drv")
#: endings that can be read
READ_SUFFIXES = (".csv", ".txt", ".tsv", ".lvm", ".parquet", ".mf4", ".mdf", ".dat", ".tdms", *RPC_SUFFIXES)
#: endings that can be written
WRITE_SUFFIXES = (".csv", ".parquet", ".mf4", *RPC_SUFFIXES)
