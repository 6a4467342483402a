"""Fetching TUM RGB-D sequences: resumed, checked, and unpacked whole or not at all."""

import errno
import gzip
import shutil
import tarfile
import urllib.error
import urllib.request
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http.client import HTTPException, HTTPResponse
from pathlib import Path

from semslam.datasets.tum_names import folder_name
from semslam.errors import DatasetError

BASE_URL = "https://cvg.cit.tum.de/rgbd/dataset"
TIMEOUT_S = 30.0
CHUNK_BYTES = 1 << 18

DownloadProgress = Callable[[int, int | None], None]


def download(
    name: str, directory: str | Path, progress: DownloadProgress | None = None, base_url: str = BASE_URL
) -> Path:
    """Fetch and unpack a TUM RGB-D sequence by its short name.

    What has arrived stays in a ``.part`` file when the download is interrupted, and the next call goes on from
    there. The archive is read to its end, checksum included, into a hidden folder, which gets its name last; then
    the archive is removed. A sequence that is there already is left as it is.

    Args:
        name: such as "fr1/room".
        directory: where the sequence's folder goes; made if needed.
        progress: called with the bytes so far and the total (None where the server does not say).
        base_url: a mirror laid out like the benchmark's server.

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
            _fetch(url, archive, progress or (lambda done, total: None))
        _unpack(archive, target)
    return target


def _fetch(url: str, archive: Path, progress: DownloadProgress) -> None:
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
            while chunk := response.read(CHUNK_BYTES):
                done += stream.write(chunk)
                progress(done, total)
    if total is not None and done != total:
        raise DatasetError(
            f"The connection ended after {_megabytes(done)} of {_megabytes(total)} of {url}; run it again to go on."
        )
    part.replace(archive)


def _request(url: str, have: int) -> HTTPResponse:
    """Ask for the bytes from ``have`` on, or for everything where those are not to be had."""
    if not url.startswith(("http://", "https://")):
        raise DatasetError(f"'{url}' is no http or https address.")
    request = urllib.request.Request(url, headers={"Range": f"bytes={have}-"} if have else {})
    try:
        response: HTTPResponse = urllib.request.urlopen(request, timeout=TIMEOUT_S)
    except urllib.error.HTTPError as error:
        error.close()
        if error.code != 416:
            raise
        response = urllib.request.urlopen(url, timeout=TIMEOUT_S)  # the part is whole, or longer than the file
    return response


def _place_of(response: HTTPResponse, have: int) -> tuple[int, int | None]:
    """Where in the file the answer begins, and the file's size."""
    length = response.headers.get("Content-Length")
    if response.status != 206:
        return 0, int(length) if length else None
    span, _, total = response.headers.get("Content-Range", "").removeprefix("bytes ").partition("/")
    if span.partition("-")[0] != str(have):
        raise DatasetError(f"The server answered with other bytes than asked for ({span}); remove the .part file.")
    return have, int(total) if total.isdigit() else None


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
    except (tarfile.TarError, EOFError, zlib.error, gzip.BadGzipFile) as error:
        archive.unlink()
        raise DatasetError(f"The archive {archive} is damaged ({error}); it was removed, so run it again.") from error
    finally:
        shutil.rmtree(work, ignore_errors=True)


def _extract(archive: Path, work: Path) -> None:
    """Unpack plain files and folders below ``work``, and read on to the checksum at the archive's end."""
    with gzip.open(archive) as stream:
        with tarfile.open(fileobj=stream, mode="r|") as tar:
            tar.extraction_filter = getattr(tarfile, "data_filter", None)  # absent from the oldest 3.11
            for member in tar:
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
    except (TimeoutError, ConnectionError, HTTPException) as error:
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
