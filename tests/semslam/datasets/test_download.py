"""Downloads, against a server on this machine."""

import errno
import shutil
import socket
import tarfile
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from semslam.datasets.download import download
from semslam.datasets.tum_names import folder_name, short_names
from semslam.errors import DatasetError
from tests.semslam.datasets.archive_server import FOLDER, PAYLOAD, Server, make_archive


@pytest.fixture
def server() -> Iterator[Server]:
    with Server() as running:
        thread = threading.Thread(target=running.serve_forever, kwargs={"poll_interval": 0.01}, daemon=True)
        thread.start()
        yield running
        running.shutdown()
        thread.join()


def names(folder: Path) -> list[str]:
    return sorted(file.name for file in folder.iterdir())


def assert_complete(folder: Path, path: Path) -> None:
    assert path == folder / FOLDER
    assert names(folder) == [FOLDER]
    assert (path / "rgb" / "1.png").read_bytes() == PAYLOAD


def test_a_sequence_is_fetched_unpacked_and_tidied_up(server: Server, tmp_path: Path) -> None:
    calls: list[tuple[int, int | None]] = []
    path = download("fr1/room", tmp_path / "new", lambda done, total: calls.append((done, total)), server.url)
    assert_complete(tmp_path / "new", path)
    assert server.requests == [(f"/dataset/freiburg1/{FOLDER}.tgz", None)]
    size = len(server.content)
    assert calls[0] == (0, size)
    assert calls[-1] == (size, size)
    assert calls == sorted(calls)


def test_what_is_there_is_not_fetched_again(server: Server, tmp_path: Path) -> None:
    (tmp_path / FOLDER).mkdir()
    assert download("fr1/room", tmp_path, base_url=server.url) == tmp_path / FOLDER
    assert server.requests == []


def test_an_interrupted_download_goes_on_where_it_stopped(server: Server, tmp_path: Path) -> None:
    server.break_after = 250_000
    with pytest.raises(DatasetError, match=r"ended after 0\.2 MB of 0\.6 MB .* run it again"):
        download("fr1/room", tmp_path, base_url=server.url)
    assert names(tmp_path) == [f"{FOLDER}.tgz.part"]
    server.break_after = None
    path = download("fr1/room", tmp_path, base_url=server.url)
    assert server.requests[-1][1] == "bytes=250000-"
    assert_complete(tmp_path, path)


def test_ctrl_c_leaves_a_part_to_go_on_with(server: Server, tmp_path: Path) -> None:
    def interrupt(done: int, total: int | None) -> None:
        if done > 300_000:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        download("fr1/room", tmp_path, interrupt, server.url)
    kept = (tmp_path / f"{FOLDER}.tgz.part").stat().st_size
    assert kept > 300_000
    assert_complete(tmp_path, download("fr1/room", tmp_path, base_url=server.url))
    assert server.requests[-1][1] == f"bytes={kept}-"


def test_a_server_without_ranges_sends_everything_again(server: Server, tmp_path: Path) -> None:
    server.ranges = False
    (tmp_path / f"{FOLDER}.tgz.part").write_bytes(b"x" * 1000)
    assert_complete(tmp_path, download("fr1/room", tmp_path, base_url=server.url))


def test_a_part_that_is_too_long_is_thrown_away(server: Server, tmp_path: Path) -> None:
    (tmp_path / f"{FOLDER}.tgz.part").write_bytes(b"x" * (len(server.content) + 5))
    assert_complete(tmp_path, download("fr1/room", tmp_path, base_url=server.url))
    assert [wanted is None for _, wanted in server.requests] == [False, True]


def test_a_server_that_hides_the_length_is_checked_by_the_archive(server: Server, tmp_path: Path) -> None:
    server.tell_length, server.break_after = False, 400_000
    with pytest.raises(DatasetError, match="is damaged"):
        download("fr1/room", tmp_path, base_url=server.url)
    assert names(tmp_path) == []
    server.break_after = None
    assert_complete(tmp_path, download("fr1/room", tmp_path, base_url=server.url))


@pytest.mark.parametrize("kind", ["cut", "checksum", "rubbish"])
def test_a_damaged_archive_is_removed(server: Server, tmp_path: Path, kind: str) -> None:
    whole = server.content
    server.content = {"cut": whole[:-5000], "checksum": whole[:-8] + b"\0" * 8, "rubbish": b"rubbish" * 100}[kind]
    with pytest.raises(DatasetError, match="is damaged"):
        download("fr1/room", tmp_path, base_url=server.url)
    assert names(tmp_path) == []


def _link(name: str, target: str) -> tarfile.TarInfo:
    info = tarfile.TarInfo(name)
    info.type, info.linkname = tarfile.SYMTYPE, target
    return info


@pytest.mark.parametrize(
    "content",
    [
        make_archive({f"{FOLDER}/a": b"a", "../evil.txt": b"evil"}),
        make_archive({f"{FOLDER}/../../evil.txt": b"evil"}),
        make_archive({"/tmp/semslam-evil.txt": b"evil"}),
        make_archive(extra=_link(f"{FOLDER}/evil", "/etc")),
    ],
)
def test_an_archive_that_reaches_outside_is_refused(server: Server, tmp_path: Path, content: bytes) -> None:
    server.content = content
    with pytest.raises(DatasetError, match="not safe to unpack"):
        download("fr1/room", tmp_path / "data", base_url=server.url)
    assert names(tmp_path / "data") == []
    assert names(tmp_path) == ["data"]
    assert not Path("/tmp/semslam-evil.txt").exists()


def test_an_archive_of_something_else_is_refused(server: Server, tmp_path: Path) -> None:
    server.content = make_archive({"other/rgb.txt": b""})
    with pytest.raises(DatasetError, match=f"does not hold the folder {FOLDER}"):
        download("fr1/room", tmp_path, base_url=server.url)


@pytest.mark.parametrize("status", [403, 404, 503])
def test_a_refusal_is_one_sentence(server: Server, tmp_path: Path, status: int) -> None:
    server.error = status
    with pytest.raises(DatasetError, match=f"answered {status}") as caught:
        download("fr1/room", tmp_path, base_url=server.url)
    assert server.url in str(caught.value)


def test_no_network_is_one_sentence(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as unused:
        url = f"http://127.0.0.1:{unused.getsockname()[1]}"
    with pytest.raises(DatasetError, match="no connection to http"):
        download("fr1/room", tmp_path, base_url=url)
    with pytest.raises(DatasetError, match="no http or https"):
        download("fr1/room", tmp_path, base_url="file:///etc")


def test_a_full_disk_is_one_sentence(server: Server, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    usage = shutil.disk_usage(tmp_path)
    with monkeypatch.context() as patched:
        patched.setattr(shutil, "disk_usage", lambda _: usage._replace(free=1000))
        with pytest.raises(DatasetError, match=r"too full .* 0\.6 MB are to come"):
            download("fr1/room", tmp_path, base_url=server.url)

    def full(done: int, total: int | None) -> None:
        if done > 300_000:
            raise OSError(errno.ENOSPC, "No space left on device")

    with pytest.raises(DatasetError, match="the disk is full"):
        download("fr1/room", tmp_path, full, server.url)
    assert_complete(tmp_path, download("fr1/room", tmp_path, base_url=server.url))


def test_a_folder_that_cannot_be_made_is_one_sentence(server: Server, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(DatasetError, match="cannot be stored"):
        download("fr1/room", tmp_path / "file", base_url=server.url)


@pytest.mark.parametrize(
    ("name", "folder"),
    [
        ("fr1/room", FOLDER),
        ("FR1_room", FOLDER),
        ("freiburg1_room", FOLDER),
        (FOLDER, FOLDER),
        ("fr2/large_with_loop", "rgbd_dataset_freiburg2_large_with_loop"),
        ("fr3/long_office", "rgbd_dataset_freiburg3_long_office_household"),
        ("fr3/office", "rgbd_dataset_freiburg3_long_office_household"),
    ],
)
def test_short_names(name: str, folder: str) -> None:
    assert folder_name(name) == folder


def test_every_listed_name_is_known() -> None:
    assert len(short_names()) == 47
    assert len({folder_name(name) for name in short_names()}) == 47


def test_an_unknown_name_suggests_the_nearest(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match=r"no TUM RGB-D sequence 'fr1/rooom'; near to it: fr1/room"):
        download("fr1/rooom", tmp_path)
    with pytest.raises(DatasetError, match="no TUM RGB-D sequence"):
        folder_name("")


def test_what_is_no_archive_is_refused_before_it_is_stored(server: Server, tmp_path: Path) -> None:
    server.content = b"<html>not here any more</html>" * 1000
    with pytest.raises(DatasetError, match="it is no gzip archive"):
        download("fr1/room", tmp_path, base_url=server.url)
    assert names(tmp_path) == []
    server.content = make_archive()
    assert_complete(tmp_path, download("fr1/room", tmp_path, base_url=server.url))


def test_a_retry_after_a_bad_archive_starts_anew(server: Server, tmp_path: Path) -> None:
    whole = server.content
    (tmp_path / f"{FOLDER}.tgz.part").write_bytes(b"rubbish" * 1000)
    with pytest.raises(DatasetError, match="is damaged"):
        download("fr1/room", tmp_path, base_url=server.url)
    assert names(tmp_path) == []
    server.content = whole
    assert_complete(tmp_path, download("fr1/room", tmp_path, base_url=server.url))
    assert server.requests[-1][1] is None


@pytest.mark.parametrize("place", ["file:///etc/passwd", "ftp://127.0.0.1/a.tgz", "data:,hello"])
def test_redirects_stay_on_http(server: Server, tmp_path: Path, place: str) -> None:
    server.redirect = place
    with pytest.raises(DatasetError, match=r"not safe to follow|answered 302"):
        download("fr1/room", tmp_path, base_url=server.url)
    assert names(tmp_path) == []


def test_redirects_to_http_are_followed(server: Server, tmp_path: Path) -> None:
    server.redirect = f"{server.url}/elsewhere.tgz"
    assert_complete(tmp_path, download("fr1/room", tmp_path, base_url=server.url))
    assert server.requests[-1][0] == "/dataset/elsewhere.tgz"


def test_a_server_that_sends_drop_by_drop_meets_the_time_limit(server: Server, tmp_path: Path) -> None:
    server.drops = True
    with pytest.raises(DatasetError, match=r"takes too long: .* run it again to go on"):
        download("fr1/room", tmp_path, base_url=server.url, time_limit=0.2)
    kept = (tmp_path / f"{FOLDER}.tgz.part").stat().st_size
    assert 0 < kept < len(server.content)
    server.drops = False
    assert_complete(tmp_path, download("fr1/room", tmp_path, base_url=server.url))


def test_a_server_that_never_answers_is_given_up(
    server: Server, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("semslam.datasets.download.ANSWER_LIMIT_S", 0.2)
    server.hold.clear()
    try:
        with pytest.raises(DatasetError, match="was lost"):
            download("fr1/room", tmp_path, base_url=server.url)
    finally:
        server.hold.set()


def test_an_archive_that_unpacks_beyond_the_disk_is_refused(
    server: Server, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("semslam.datasets.download.MAX_UNPACKED_BYTES", 1000)
    with pytest.raises(DatasetError, match="unpacks to more than"):
        download("fr1/room", tmp_path, base_url=server.url)
    assert names(tmp_path) == []


def test_a_server_that_sends_without_end_is_cut_off(
    server: Server, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("semslam.datasets.download.MAX_ARCHIVE_BYTES", 100)
    with pytest.raises(DatasetError, match="is too large"):
        download("fr1/room", tmp_path, base_url=server.url)
