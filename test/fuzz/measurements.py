# Copyright 2026 ride_estimation contributors
"""Readers of measurement files as fuzz targets; those whose library is not installed are left out."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from pathlib import Path

import numpy as np

from fuzz.recordings import SENSORS
from ride_estimation.io.files.channel_map import components, default_map, load_channel_map
from ride_estimation.io.files.channels import UNKNOWN_START_NS, FileChannel
from ride_estimation.io.files.conversion import recording_from_file
from ride_estimation.io.files.formats import read_measurement_file, write_measurement_file

MAP = """\
schema: ride_estimation/channels/1
time: {channel: Time, unit: ms}
channels:
  accel.x: AX
  accel.y: {channel: AY, unit: g, factor: -1.0}
  accel.z: {channel: AZ, unit: m/s^2, offset: 0.5}
  fl_z: {channel: Pot, unit: mm}
"""


def channels() -> tuple[FileChannel, ...]:
    rng = np.random.default_rng(0)
    time = np.arange(50) * 0.002
    return tuple(
        FileChannel(name, unit, time, rng.normal(size=len(time))) for s in SENSORS.values() for name, unit in components(s)
    )


def read(file: Path, folder: Path) -> None:
    found = read_measurement_file(file)
    known = default_map(SENSORS)
    names = {channel.name for channel in found.channels}
    recording_from_file(found, SENSORS, type(known)({n: s for n, s in known.sources.items() if n in names}))


def read_map(file: Path, folder: Path) -> None:
    load_channel_map(file, SENSORS)


def written(suffix: str) -> Callable[[Path], list[bytes]]:
    def seeds(folder: Path) -> list[bytes]:
        file = folder / f"run{suffix}"
        write_measurement_file(file, [channels()], UNKNOWN_START_NS)
        return [file.read_bytes()]

    return seeds


def tdms(folder: Path) -> list[bytes]:
    import nptdms

    waveform = {"wf_increment": 0.002, "wf_start_time": np.datetime64("2026-05-01T12:00:00", "us")}
    time = nptdms.ChannelObject("daq", "time", channels()[0].time_s, properties={"unit_string": "s"})
    found = []
    for name, properties, more in (("waveform", waveform, []), ("table", {}, [time])):
        objects = [
            nptdms.ChannelObject("daq", c.name, c.values, properties={**properties, "unit_string": c.unit}) for c in channels()
        ] + more
        with nptdms.TdmsWriter(folder / name) as writer:
            writer.write_segment(objects)
        found.append((folder / name).read_bytes())
    return found


def lvm(folder: Path) -> list[bytes]:
    return [lvm_text([(c.name, c.unit, c.values) for c in channels()], 0.002, way).encode() for way in ("One", "No")]


def lvm_text(columns: list[tuple[str, str, np.ndarray]], step: float, x_columns: str, comma: bool = False) -> str:
    """Return a LabVIEW measurement file as LabVIEW writes it, with the column of comments."""
    decimal, end = "," if comma else ".", "***End_of_Header***"
    lines = ["LabVIEW Measurement", "Writer_Version\t2", "Separator\tTab", f"Decimal_Separator\t{decimal}", "Multi_Headings\tNo"]
    lines += [f"X_Columns\t{x_columns}", "Date\t2026/05/01", end, "", f"Channels\t{len(columns)}"]
    lines += ["\t".join(["Samples", *(str(len(values)) for _, _, values in columns)])]
    lines += ["\t".join(["Y_Unit_Label", *(unit for _, unit, _ in columns)]), "\t".join(["X0", *["0.0"] * len(columns)])]
    lines += ["\t".join(["Delta_X", *[str(step).replace(".", decimal)] * len(columns)]), end]
    pairs = x_columns == "Multi"
    names = [cell for name, _, _ in columns for cell in (["X_Value", name] if pairs else [name])]
    lines.append("\t".join([*([] if pairs else ["X_Value"]), *names, "Comment"]))
    for k in range(len(columns[0][2])):
        x = f"{k * step:.6f}"
        row = [cell for _, _, values in columns for cell in ([x, repr(float(values[k]))] if pairs else [repr(float(values[k]))])]
        cells = [*([] if pairs else [x if x_columns == "One" else ""]), *row]
        lines.append("\t".join(cells).replace(".", decimal) + ("\tstart of run" if k == 0 else ""))
    return "\n".join(lines) + "\n"


def rpc(folder: Path) -> list[bytes]:
    import rpc3

    rpc3.write(str(folder / "run.rpc"), [rpc3.Channel(c.name, c.unit, 0.002, c.values) for c in channels()], datatype=float)
    return [(folder / "run.rpc").read_bytes()]


#: name -> suffix, library it needs, good files, words of the format
_FORMATS: dict[str, tuple[str, str, Callable[[Path], list[bytes]], tuple[bytes, ...]]] = {
    "csv": (".csv", "csv", written(".csv"), (b",", b";", b"\t", b"\n", b"[ms]", b"nan", b"1e999", b'"', b"time", b"text")),
    "lvm": (".lvm", "csv", lvm, (b"\t", b"***End_of_Header***", b"X_Value", b"Delta_X\t", b"X0\t", b"nan", b"1e999", b",")),
    "tdms": (".tdms", "nptdms", tdms, (b"TDSm", b"wf_increment", b"unit_string", b"/'daq'")),
    "rpc": (".rpc", "rpc3", rpc, (b"FORMAT", b"BINARY", b"NUM_HEADER_BLOCKS", b"CHANNELS", b"DELTA_T", b"PTS_PER_FRAME")),
    "parquet": (".parquet", "pyarrow", written(".parquet"), (b"PAR1", b"time", b"unit")),
    "mdf": (".mf4", "asammdf", written(".mf4"), (b"##DT", b"##DZ", b"##DL", b"##CN", b"##CG", b"##HL", b"4.10", b"3.30")),
}


def measurement_formats() -> dict[str, tuple[str, Callable[[Path], list[bytes]], tuple[bytes, ...]]]:
    """Return suffix, good files and words of every format that can be read here."""
    return {
        name: (suffix, seeds, words)
        for name, (suffix, library, seeds, words) in _FORMATS.items() if importlib.util.find_spec(library)
    }  # fmt: skip
