"""A server of one archive on this machine, with the faults of real ones."""

import io
import tarfile
import threading
import time
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

import numpy as np

FOLDER = "rgbd_dataset_freiburg1_room"
PAYLOAD = np.random.default_rng(0).bytes(600_000)


def make_archive(members: dict[str, bytes] | None = None, extra: tarfile.TarInfo | None = None) -> bytes:
    buffer = io.BytesIO()
    with tarfile.open(fileobj=buffer, mode="w:gz") as tar:
        for name, content in (
            members or {f"{FOLDER}/rgb.txt": b"1 rgb/1.png\n", f"{FOLDER}/rgb/1.png": PAYLOAD}
        ).items():
            info = tarfile.TarInfo(name)
            info.size = len(content)
            tar.addfile(info, io.BytesIO(content))
        if extra is not None:
            tar.addfile(extra)
    return buffer.getvalue()


class Server(ThreadingHTTPServer):
    """Serves one file; can break off, deny ranges, hide the length, or answer with an error."""

    daemon_threads = True

    def __init__(self) -> None:
        super().__init__(("127.0.0.1", 0), Handler)
        self.content = make_archive()
        self.break_after: int | None = None
        self.ranges = True
        self.tell_length = True
        self.error: int | None = None
        self.redirect: str | None = None
        self.drops = False
        self.hold = threading.Event()
        self.hold.set()
        self.requests: list[tuple[str, str | None]] = []

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.server_port}/dataset"

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A client that hangs up is part of these tests."""


class Handler(BaseHTTPRequestHandler):
    server: Server

    def do_GET(self) -> None:
        server, wanted = self.server, self.headers.get("Range")
        server.requests.append((self.path, wanted))
        server.hold.wait(5)
        if server.redirect:
            self.send_response(302)
            self.send_header("Location", server.redirect)
            self.end_headers()
            server.redirect = None
            return
        if server.error:
            self.send_error(server.error)
            return
        size, start = len(server.content), 0
        if wanted and server.ranges:
            start = int(wanted.removeprefix("bytes=").rstrip("-"))
            if start >= size:
                self.send_error(416)
                return
            self.send_response(206)
            self.send_header("Content-Range", f"bytes {start}-{size - 1}/{size}")
        else:
            self.send_response(200)
        body = server.content[start:]
        if server.tell_length:
            self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        if server.drops:
            for start in range(0, len(body), 100):
                self.wfile.write(body[start : start + 100])
                time.sleep(0.01)
            return
        self.wfile.write(body[: server.break_after])
        self.close_connection = True

    def log_message(self, format: str, *args: Any) -> None:
        pass
