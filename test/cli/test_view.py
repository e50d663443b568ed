# Copyright 2026 ride_estimation contributors
"""The folder of a replay served to a viewer: parts of files, to one viewer, from this machine, and nothing outside of it."""

from __future__ import annotations

import functools
import http.client
import http.server
import json
import threading
from collections.abc import Iterator
from http.server import ThreadingHTTPServer
from pathlib import Path
from urllib.parse import parse_qs, urlsplit

import pytest
from browser import PROGRAM, Browser

from ride_estimation.cli.main import main
from ride_estimation.io.folder_server import folder_server

CONTENT = bytes(range(256)) * 300


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "secret.txt").write_text("secret")
    out = tmp_path / "out"
    (out / "pictures").mkdir(parents=True)
    (out / "run.mcap").write_bytes(CONTENT)
    (out / "report.html").write_text("<p>report</p>")
    (out / "link.txt").symlink_to(tmp_path / "secret.txt")
    return out


@pytest.fixture
def server(folder: Path) -> Iterator[ThreadingHTTPServer]:
    with folder_server(folder, 0, "http://localhost:8080") as made:
        thread = threading.Thread(target=made.serve_forever, kwargs={"poll_interval": 0.01})
        thread.start()
        yield made
        made.shutdown()
        thread.join()


def asked(
    server: ThreadingHTTPServer, path: str, method: str = "GET", **headers: str
) -> tuple[int, dict[str, str], bytes]:
    connection = http.client.HTTPConnection("127.0.0.1", server.server_address[1], timeout=10.0)
    connection.request(method, path, headers=headers)
    answer = connection.getresponse()
    body = answer.read()
    connection.close()
    return answer.status, {k.lower(): v for k, v in answer.getheaders()}, body


@pytest.mark.parametrize(
    ("wanted", "first", "last"), [("bytes=0-9", 0, 9), ("bytes=70000-", 70000, 76799), ("bytes=-5", 76795, 76799),
                                  ("bytes=76000-99999999", 76000, 76799)]
)  # fmt: skip
def test_a_part_of_a_file_is_what_was_asked_for(server: ThreadingHTTPServer, wanted: str, first: int, last: int) -> None:
    status, heads, body = asked(server, "/run.mcap", Range=wanted)
    assert (status, body) == (206, CONTENT[first : last + 1])
    assert heads["content-range"] == f"bytes {first}-{last}/{len(CONTENT)}"
    assert heads["access-control-allow-origin"] == "http://localhost:8080"
    assert "Content-Range" in heads["access-control-expose-headers"]


def test_whole_files_heads_and_permissions(server: ThreadingHTTPServer) -> None:
    status, heads, body = asked(server, "/run.mcap")
    assert (status, body, heads["accept-ranges"]) == (200, CONTENT, "bytes")
    status, heads, body = asked(server, "/run.mcap", "HEAD")
    assert (status, body, heads["content-length"]) == (200, b"", str(len(CONTENT)))
    status, heads, _ = asked(server, "/run.mcap", "OPTIONS")
    assert status == 204 and "Range" in heads["access-control-allow-headers"]
    assert asked(server, "/")[2] == b"<p>report</p>"


@pytest.mark.parametrize(
    "wanted", ["bytes=80000-", "bytes=9-3", "bytes=-", "bytes=a-b", "bytes=0-1,4-5", "bytes=" + "9" * 40 + "-"]
)
def test_a_part_that_cannot_be_had_is_refused(server: ThreadingHTTPServer, wanted: str) -> None:
    status, heads, body = asked(server, "/run.mcap", Range=wanted)
    assert (status, body, heads["content-range"]) == (416, b"", f"bytes */{len(CONTENT)}")


@pytest.mark.parametrize(
    "path", ["/../secret.txt", "/%2e%2e/secret.txt", "/link.txt", "//etc/passwd", "/pictures", "/none", "/%00", "/" + "a" * 5000]
)
def test_nothing_outside_of_the_folder_is_served(server: ThreadingHTTPServer, path: str) -> None:
    status, _, body = asked(server, path)
    assert (status, body) == (404, b"")


def test_only_this_machine_is_answered(server: ThreadingHTTPServer) -> None:
    assert server.server_address[0] == "127.0.0.1"
    # a page of a name that leads here is refused
    assert asked(server, "/run.mcap", Host="elsewhere.example:80")[0] == 404


def test_the_links_lead_to_the_files(folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    opened: list[str] = []

    def interrupted(_: ThreadingHTTPServer) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(ThreadingHTTPServer, "serve_forever", interrupted)
    monkeypatch.setattr("webbrowser.open", opened.append)
    assert main(["view", str(folder)]) == 0
    lines = dict(line.split(None, 1) for line in capsys.readouterr().out.splitlines() if line.strip())
    assert opened == [lines["report"]]
    link = urlsplit(lines["Lichtblick"])
    given = parse_qs(link.query)
    here = lines["report"].removesuffix("/report.html")
    assert (link.netloc, given["ds"]) == ("localhost:8080", ["remote-file"])
    assert (given["ds.url"], given["layoutUrl"]) == ([f"{here}/run.mcap"], [f"{here}/run_layout.json"])


@pytest.mark.parametrize(
    ("extra", "words"),
    [(["--port", "99999"], "--port 99999"), (["--viewer", "nowhere"], "--viewer nowhere"), ([], "neither report.html nor")],
)
def test_mistakes_are_one_line(folder: Path, extra: list[str], words: str, capsys: pytest.CaptureFixture[str]) -> None:
    target = folder if extra else folder / "pictures"
    assert main(["view", str(target), *extra]) == 2
    assert words in capsys.readouterr().err


#: what a viewer of recordings asks for: size by a part of one byte, a later part, the layout as a whole
READ = """(async () => {
  const head = await fetch("%(run)s", {headers: {range: "bytes=0-0"}, cache: "no-store"});
  const part = await fetch("%(run)s", {headers: {range: "bytes=70000-70003"}});
  const all = await fetch("%(run)s", {cache: "no-store"});
  const seen = ["content-range", "etag"].map(name => head.headers.get(name));
  const bytes = [...new Uint8Array(await part.arrayBuffer())];
  return JSON.stringify([head.status, ...seen, part.status, bytes, all.headers.get("accept-ranges"),
    all.headers.get("content-length"), await (await fetch("%(page)s")).text()]);
})()"""


@pytest.mark.skipif(PROGRAM is None, reason="no browser is installed")
def test_a_browser_lets_the_viewer_read_and_no_other_page(folder: Path, tmp_path: Path) -> None:
    """Two pages of other origins in a real browser: the viewer gets parts with their heads, the stranger nothing."""
    handler = functools.partial(http.server.SimpleHTTPRequestHandler, directory=str(folder / "pictures"))
    (folder / "pictures" / "index.html").write_text("<link rel=icon href=data:,>")
    pages = [http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) for _ in range(2)]
    viewer, stranger = (f"http://127.0.0.1:{page.server_address[1]}" for page in pages)
    files = folder_server(folder, 0, viewer)
    threads = [threading.Thread(target=each.serve_forever, kwargs={"poll_interval": 0.01}) for each in (files, *pages)]
    for thread in threads:
        thread.start()
    here = f"http://127.0.0.1:{files.server_address[1]}"
    read = READ % {"run": f"{here}/run.mcap", "page": f"{here}/report.html"}
    browser = Browser(tmp_path / "profile")
    try:
        browser.open(viewer, 800, 600)
        status, content_range, etag, part_status, part, accepted, length, page = json.loads(browser.run(read))
        assert (status, content_range, part_status) == (206, f"bytes 0-0/{len(CONTENT)}", 206)
        assert part == list(CONTENT[70000:70004]) and etag
        assert (accepted, length, page) == ("bytes", str(len(CONTENT)), "<p>report</p>")
        browser.open(stranger, 800, 600)
        assert browser.run(f'fetch("{here}/report.html").then(() => "read", () => "refused")') == "refused"
    finally:
        browser.close()
        for each, thread in zip((files, *pages), threads, strict=True):
            each.shutdown()
            thread.join()
            each.server_close()
