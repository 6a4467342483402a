"""Fetching TUM RGB-D sequences: resumed, checked, and unpacked whole or not at all."""

import errno
import gzip
import shutil
import ssl
import tarfile
import threading
import time
import urllib.error
import urllib.request
import zlib
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from http.client import HTTPException, HTTPMessage, HTTPResponse
from pathlib import Path
from typing import IO

from semslam.datasets.tum_names import folder_name
from semslam.errors import DatasetError, shortened

BASE_URL = "https://cvg.cit.tum.de/rgbd/dataset"
TIMEOUT_S = 30.0
ANSWER_LIMIT_S = 120.0
"""A server has to have answered, redirects included, by then."""
TIME_LIMIT_S = 12 * 3600.0
MAX_ARCHIVE_BYTES, MAX_UNPACKED_BYTES, MAX_MEMBERS = 32 * 2**30, 128 * 2**30, 1_000_000
CHUNK_BYTES = 1 << 18
GZIP_START = b"\x1f\x8b"

DownloadProgress = Callable[[int, int | None], None]


class _HttpRedirects(urllib.request.HTTPRedirectHandler):
    """Follows redirects to http and https alone, and none from https to http."""

    def redirect_request(
        self, req: urllib.request.Request, fp: IO[bytes], code: int, msg: str, headers: HTTPMessage, newurl: str
    ) -> urllib.request.Request | None:
        """The request for the new place.

        Raises:
            DatasetError: the new place is not allowed.
        """
        allowed = ("https://",) if req.full_url.startswith("https://") else ("http://", "https://")
        if not newurl.lower().startswith(allowed):
            raise DatasetError(f"{req.full_url} leads to '{shortened(newurl)}', which is not safe to follow.")
        return super().redirect_request(req, fp, code, msg, headers, newurl)


def download(
    name: str,
    directory: str | Path,
    progress: DownloadProgress | None = None,
    base_url: str = BASE_URL,
    time_limit: float = TIME_LIMIT_S,
) -> Path:
    """Fetch and unpack a TUM RGB-D sequence by its short name.

    What has arrived stays in a ``.part`` file when the download is interrupted, and the next call goes on from
    there. The archive is read to its end, checksum included, into a hidden folder, which gets its name last; then
    the archive is removed. A sequence that is there already is left as it is.

    Args:
        name: such as "fr1/room".
        directory: where the sequence's folder goes; made if needed.
        progress: called with the bytes so far and the total (None where the server states none).
        base_url: a mirror laid out like the benchmark's server.
        time_limit: seconds that the transfer may take; what has arrived by then is kept for the next call.

    Returns:
        The sequence's folder.

    Raises:
        DatasetError: the name is unknown, the network or the disk fails, or the archive is damaged or unsafe.
    """
    folder, directory = folder_name(name), Path(directory)
    target, archive = directory / folder, directory / f"{folder}.tgz"
    if target.is_dir():
        return target
    with _disk_errors(directory):
        directory.mkdir(parents=True, exist_ok=True)
        if not archive.exists():
            url = f"{base_url.rstrip('/')}/{folder.split('_')[2]}/{folder}.tgz"
            _fetch(url, archive, progress or (lambda done, total: None), time.monotonic() + time_limit)
        _unpack(archive, target)
    return target


def _fetch(url: str, archive: Path, progress: DownloadProgress, deadline: float) -> None:
    """Download into ``archive`` by way of its .part file, from where that ends."""
    part = archive.with_name(f"{archive.name}.part")
    have = part.stat().st_size if part.exists() else 0
    with _network_errors(url), _request(url, have) as response:
        offset, total = _place_of(response, have)
        if total is not None and shutil.disk_usage(archive.parent).free < total - offset:
            raise DatasetError(f"The disk is too full for {archive.name}: {_megabytes(total - offset)} are to come.")
        with part.open("r+b" if offset else "wb") as stream:
            done = stream.seek(offset)
            progress(done, total)
            # read1 returns after each packet: a server that sends drop by drop meets the deadline too.
            while chunk := response.read1(CHUNK_BYTES):
                if done == 0 and not chunk.startswith(GZIP_START[: len(chunk)]):
                    part.unlink()
                    raise DatasetError(f"What {url} sends is damaged: it is no gzip archive.")
                done += stream.write(chunk)
                progress(done, total)
                if done > MAX_ARCHIVE_BYTES:
                    raise DatasetError(f"{url} is too large: more than {_megabytes(MAX_ARCHIVE_BYTES)}.")
                if time.monotonic() > deadline:
                    raise DatasetError(f"{url} takes too long: {_megabytes(done)} so far; run it again to go on.")
    if total is not None and done != total:
        raise DatasetError(
            f"The connection ended after {_megabytes(done)} of {_megabytes(total)} of {url}; run it again to go on."
        )
    part.replace(archive)


def _request(url: str, have: int) -> HTTPResponse:
    """Ask for the bytes from ``have`` on, or for everything where those are not to be had."""
    if not url.startswith(("http://", "https://")):
        raise DatasetError(f"'{url}' is no http or https address.")
    try:
        return _answer(urllib.request.Request(url, headers={"Range": f"bytes={have}-"} if have else {}))
    except urllib.error.HTTPError as error:
        error.close()
        if error.code != 416:
            raise
        return _answer(urllib.request.Request(url))  # the part is whole, or longer than the file


def _answer(request: urllib.request.Request) -> HTTPResponse:
    """Open a connection in a thread that is given up where headers come too slowly to trip the socket's timeout."""
    answer: Future[HTTPResponse] = Future()
    opener = urllib.request.build_opener(_HttpRedirects)

    def ask() -> None:
        try:
            answer.set_result(opener.open(request, timeout=TIMEOUT_S))
        except Exception as error:  # handed to the caller
            answer.set_exception(error)

    threading.Thread(target=ask, name="semslam-download", daemon=True).start()
    return answer.result(ANSWER_LIMIT_S)


def _place_of(response: HTTPResponse, have: int) -> tuple[int, int | None]:
    """Where in the file the answer begins, and the file's size."""
    length = response.headers.get("Content-Length")
    if response.status != 206:
        return 0, int(length) if length and length.isdecimal() and len(length) < 20 else None
    span, _, total = response.headers.get("Content-Range", "").removeprefix("bytes ").partition("/")
    if span.partition("-")[0] != str(have):
        raise DatasetError(f"The server answered with other bytes than asked for ({span}); remove the .part file.")
    return have, int(total) if total.isdecimal() and len(total) < 20 else None


def _unpack(archive: Path, target: Path) -> None:
    """Unpack ``archive`` beside ``target``, give the sequence its name, remove the archive."""
    work = target.with_name(f".{target.name}.unpacking")
    shutil.rmtree(work, ignore_errors=True)
    try:
        work.mkdir()
        _extract(archive, work)
        if not (work / target.name).is_dir():
            raise DatasetError(f"The archive {archive} does not hold the folder {target.name}.")
        (work / target.name).replace(target)
        archive.unlink()
    except DatasetError:
        archive.unlink()
        raise
    # tarfile raises ValueErrors and the like on damaged headers; the disk's errors are no fault of the archive.
    except (tarfile.TarError, EOFError, zlib.error, gzip.BadGzipFile, ValueError, OverflowError) as error:
        archive.unlink()
        raise DatasetError(f"The archive {archive} is damaged ({error}); it was removed, so run it again.") from error
    finally:
        shutil.rmtree(work, ignore_errors=True)


def _extract(archive: Path, work: Path) -> None:
    """Unpack plain files and folders below ``work``, and read on to the checksum at the archive's end."""
    with gzip.open(archive) as stream:
        with tarfile.open(fileobj=stream, mode="r|") as tar:
            tar.extraction_filter = getattr(tarfile, "data_filter", None)  # absent from the oldest 3.11
            free, unpacked = shutil.disk_usage(work).free, 0
            for count, member in enumerate(tar):
                unpacked += member.size
                if count >= MAX_MEMBERS or unpacked > min(free, MAX_UNPACKED_BYTES):
                    raise DatasetError(f"The archive {archive} unpacks to more than the disk or a sequence holds.")
                inside = (work / member.name).resolve().is_relative_to(work.resolve())
                if not inside or not (member.isfile() or member.isdir()):
                    raise DatasetError(f"The archive {archive} is not safe to unpack: it holds '{member.name}'.")
                member.mode = 0o755 if member.isdir() else 0o644
                tar.extract(member, work, set_attrs=False)
        while stream.read(CHUNK_BYTES):
            pass


@contextmanager
def _network_errors(url: str) -> Iterator[None]:
    try:
        yield
    except urllib.error.HTTPError as error:
        raise DatasetError(f"The server has no {url}: it answered {error.code} {error.reason}.") from error
    except urllib.error.URLError as error:
        raise DatasetError(f"There is no connection to {url}: {error.reason}.") from error
    except (TimeoutError, ConnectionError, HTTPException, ssl.SSLError) as error:
        raise DatasetError(f"The connection to {url} was lost ({error!r}); run it again to go on.") from error


@contextmanager
def _disk_errors(directory: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        reason = "the disk is full" if error.errno == errno.ENOSPC else error.strerror or str(error)
        raise DatasetError(f"The sequence cannot be stored in {directory}: {reason}.") from error


def _megabytes(size: int) -> str:
    return f"{size / 1e6:.1f} MB"
