# Copyright 2026 ride_estimation contributors
"""Which file ending is read and written by what; every failure of a library becomes one clear error."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ride_estimation.errors import InputDataError, RideEstimationError
from ride_estimation.io.atomic import replacing
from ride_estimation.io.bag_source import READER_ERRORS
from ride_estimation.io.bounded import TooLargeError
from ride_estimation.io.files.channels import FileChannel, MeasurementFile, TimeSource, not_read
from ride_estimation.io.files.csv_file import read_csv, write_csv
from ride_estimation.io.files.lvm_file import read_lvm
from ride_estimation.io.files.mdf_file import read_mdf, write_mdf
from ride_estimation.io.files.parquet_file import read_parquet, write_parquet
from ride_estimation.io.files.rpc_file import read_rpc, write_rpc
from ride_estimation.io.files.suffixes import READ_SUFFIXES, RPC_SUFFIXES, WRITE_SUFFIXES
from ride_estimation.io.files.tdms_file import read_tdms


def read_measurement_file(path: Path, time: TimeSource | None = None) -> MeasurementFile:
    """Read a measurement file; its ending says the format.

    Parameters
    ----------
    path
        The file.
    time
        For files without time base of their own, see :func:`~ride_estimation.io.files.channels.table_channels`.

    Raises
    ------
    InputDataError
        Missing, empty or damaged file, an unknown ending, a missing extra, or no usable channel.
    """
    suffix = path.suffix.lower()
    if not path.exists():
        raise InputDataError(f"{path}: does not exist")
    if path.is_dir():
        raise InputDataError(f"{path}: is a folder; a measurement file is needed")
    if suffix not in READ_SUFFIXES:
        raise InputDataError(f"{path}: unknown kind of file; allowed: {', '.join(READ_SUFFIXES)}")
    if path.stat().st_size == 0:
        raise InputDataError(f"{path}: the file is empty")
    try:
        if suffix in (".csv", ".txt", ".tsv"):
            found = read_csv(path, time or TimeSource())
        elif suffix == ".lvm":
            found = read_lvm(path)
        elif suffix == ".parquet":
            found = read_parquet(path, time or TimeSource())
        elif suffix == ".tdms":
            found = read_tdms(path, time or TimeSource())
        elif suffix in RPC_SUFFIXES:
            found = read_rpc(path)
        else:
            found = read_mdf(path)
    except RideEstimationError:
        raise
    except TooLargeError as error:
        raise InputDataError(f"{path}: {error} for a file of this size") from error
    except READER_ERRORS as error:
        words = " ".join(str(error).split()) or type(error).__name__
        raise InputDataError(f"{path}: cannot be read as {suffix[1:].upper()} ({words}): damaged or of another kind") from error
    if not found.channels:
        raise InputDataError(f"{path}: no numeric channel in it{not_read(found.unreadable)}")
    return found


def write_measurement_file(path: Path, groups: Sequence[Sequence[FileChannel]], start_ns: int) -> None:
    """Write channels; the ending of the path says the format.

    Parameters
    ----------
    path
        File to write.
    groups
        Channels that share a time base; tables take a single group.
    start_ns
        Unix time of second zero [ns]; tables do not hold it.

    Raises
    ------
    InputDataError
        Unknown ending, a missing extra, or several time bases for a table.
    """
    suffix = path.suffix.lower()
    if suffix not in WRITE_SUFFIXES:
        raise InputDataError(f"{path}: cannot be written; allowed endings: {', '.join(WRITE_SUFFIXES)}")
    chosen = tuple(tuple(group) for group in groups if group)
    if not chosen:
        raise InputDataError(f"{path}: nothing to write")
    if suffix != ".mf4" and len(chosen) > 1:
        raise InputDataError(f"{path}: a table has one time base; {len(chosen)} were given")
    try:
        with replacing(path) as new:
            if suffix == ".mf4":
                write_mdf(new, chosen, start_ns)
            elif suffix in RPC_SUFFIXES:
                write_rpc(new, chosen[0])
            elif suffix == ".csv":
                write_csv(new, chosen[0])
            else:
                write_parquet(new, chosen[0])
    except OSError as error:
        raise InputDataError(f"{path}: cannot be written: {error.strerror or error}") from error
