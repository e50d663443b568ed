# Copyright 2026 ride_estimation contributors
"""``ride-estimation view``: the report in a browser, the recording of a replay in a viewer; both from this machine alone."""

from __future__ import annotations

import argparse
import webbrowser
from urllib.parse import urlencode, urlsplit

from ride_estimation.errors import ConfigurationError, InputDataError
from ride_estimation.io.folder_server import folder_server


def run(options: argparse.Namespace) -> int:
    """Serve the folder until Ctrl-C."""
    folder = options.folder
    if not (folder / "report.html").is_file() and not (folder / "run.mcap").is_file():
        raise InputDataError(f"{folder}: holds neither report.html nor run.mcap of a replay")
    if not 0 <= options.port <= 65535:
        raise ConfigurationError(f"--port {options.port}: allowed: 0 (a free one) to 65535")
    viewer = urlsplit(options.viewer)
    if viewer.scheme not in ("http", "https") or not viewer.netloc:
        raise ConfigurationError(f"--viewer {options.viewer}: an address as http://localhost:8080 is needed")
    try:
        server = folder_server(folder, options.port, f"{viewer.scheme}://{viewer.netloc}")
    except OSError as error:
        raise ConfigurationError(f"--port {options.port}: cannot be served: {error.strerror or error}") from error
    with server:
        here = f"http://127.0.0.1:{server.server_address[1]}"
        pages = []
        if (folder / "report.html").is_file():
            pages.append(f"{here}/report.html")
            print(f"report      {pages[-1]}")
        if (folder / "run.mcap").is_file():
            given = {"ds": "remote-file", "ds.url": f"{here}/run.mcap", "layoutUrl": f"{here}/run_layout.json"}
            print(f"Lichtblick  {options.viewer.rstrip('/')}/?{urlencode(given)}")
            print(f"recording   {here}/run.mcap (Foxglove, PlotJuggler: open {folder / 'run.mcap'})")
        else:
            print("no run.mcap: ride-estimation replay ... --mcap writes it")
        print("Ctrl-C ends", flush=True)
        if pages and not options.no_browser:
            webbrowser.open(pages[0])
        try:
            server.serve_forever()
        except KeyboardInterrupt:
            print()
    return 0
