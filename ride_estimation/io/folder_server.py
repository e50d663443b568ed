# Copyright 2026 ride_estimation contributors
"""The files of one folder over HTTP to this machine alone, in parts as viewers of recordings ask for them."""

from __future__ import annotations

import functools
import re
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import BinaryIO
from urllib.parse import unquote, urlsplit

_KINDS = {
    ".html": "text/html; charset=utf-8", ".json": "application/json", ".csv": "text/csv", ".mcap": "application/octet-stream",
    ".pdf": "application/pdf", ".png": "image/png",
}  # fmt: skip
_CHUNK = 1 << 16


def folder_server(folder: Path, port: int, origin: str) -> ThreadingHTTPServer:
    """Return a server of the files below a folder at 127.0.0.1.

    Parameters
    ----------
    folder
        Nothing outside of it is served, also not through links.
    port
        0 for a free one.
    origin
        Whose pages may read the files in a browser, as in ``http://localhost:8080``.

    Raises
    ------
    OSError
        The port is taken.
    """
    handler = functools.partial(_Handler, folder.resolve(), origin)
    return ThreadingHTTPServer(("127.0.0.1", port), handler)


class _Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"

    def __init__(self, folder: Path, origin: str, *given: object) -> None:
        self._folder, self._origin = folder, origin
        super().__init__(*given)  # type: ignore[arg-type]

    def log_message(self, format: str, *args: object) -> None:
        """Say nothing."""

    def do_OPTIONS(self) -> None:
        """Tell a browser what pages of the viewer may ask for."""
        self.send_response(HTTPStatus.NO_CONTENT)
        self._permissions()
        self.send_header("Access-Control-Allow-Methods", "GET, HEAD, OPTIONS")
        self.send_header("Access-Control-Allow-Headers", "Range")
        # browsers ask this before a page from elsewhere may reach this machine
        self.send_header("Access-Control-Allow-Private-Network", "true")
        self.send_header("Content-Length", "0")
        self.end_headers()

    def do_HEAD(self) -> None:
        """Send the head of a file."""
        self._send(body=False)

    def do_GET(self) -> None:
        """Send a file or a part of it."""
        self._send(body=True)

    def _permissions(self) -> None:
        self.send_header("Access-Control-Allow-Origin", self._origin)
        self.send_header("Access-Control-Expose-Headers", "Accept-Ranges, Content-Length, Content-Range, ETag")
        self.send_header("Vary", "Origin")

    def _send(self, body: bool) -> None:
        path = self._wanted()
        if path is None:
            return self._refuse(HTTPStatus.NOT_FOUND)
        with path.open("rb") as stream:
            size = path.stat().st_size
            first, last = 0, size - 1
            asked = self.headers.get("Range")
            if asked is not None:
                part = _part(asked, size)
                if part is None:
                    return self._refuse(HTTPStatus.REQUESTED_RANGE_NOT_SATISFIABLE, f"bytes */{size}")
                first, last = part
            self.send_response(HTTPStatus.OK if asked is None else HTTPStatus.PARTIAL_CONTENT)
            self._permissions()
            self.send_header("Content-Type", _KINDS.get(path.suffix.lower(), "application/octet-stream"))
            self.send_header("Accept-Ranges", "bytes")
            self.send_header("ETag", f'"{path.stat().st_mtime_ns:x}-{size:x}"')
            if asked is not None:
                self.send_header("Content-Range", f"bytes {first}-{last}/{size}")
            self.send_header("Content-Length", str(last - first + 1))
            self.end_headers()
            if body:
                self._copy(stream, first, last - first + 1)
        return None

    def _copy(self, stream: BinaryIO, first: int, count: int) -> None:
        stream.seek(first)
        try:
            while count > 0 and (piece := stream.read(min(count, _CHUNK))):
                self.wfile.write(piece)
                count -= len(piece)
        except (BrokenPipeError, ConnectionResetError):  # the reader has seen enough
            self.close_connection = True

    def _refuse(self, status: HTTPStatus, content_range: str = "") -> None:
        self.send_response(status)
        self._permissions()
        if content_range:
            self.send_header("Content-Range", content_range)
        self.send_header("Content-Length", "0")
        self.end_headers()

    def _wanted(self) -> Path | None:
        """Return the file that is asked for, None where there is none below the folder."""
        host = (self.headers.get("Host") or "").rpartition(":")[0] or self.headers.get("Host")
        if host not in ("127.0.0.1", "localhost"):  # a page elsewhere that gave its own name this address
            return None
        name = unquote(urlsplit(self.path).path).lstrip("/") or "report.html"
        try:
            path = (self._folder / name).resolve()
            inside = path.is_relative_to(self._folder) and path.is_file()
        except (OSError, ValueError):  # a name no file can have
            return None
        return path if inside else None


def _part(asked: str, size: int) -> tuple[int, int] | None:
    """Return first and last byte of a range ``bytes=a-b``, ``bytes=a-`` or ``bytes=-n``; None where it cannot be had."""
    found = re.fullmatch(r"bytes=(\d*)-(\d*)", asked.strip())
    if found is None or not any(found.groups()) or max(map(len, found.groups())) > 18:
        return None
    begin, end = found.groups()
    if not begin:
        first, last = max(size - int(end), 0), size - 1
    else:
        first, last = int(begin), min(int(end), size - 1) if end else size - 1
    return (first, last) if first <= last else None
