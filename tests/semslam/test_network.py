"""Nothing is sent, and nothing is written but the run folder and the cache."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
COUNTERS = ("ActiveOpens", "OutDatagrams", "OutRequests", "OutNoRoutes")
"""What the kernel counts in a network namespace: connections begun, packets sent, packets without a way out."""

CONTROL = """
import contextlib, socket
from pathlib import Path
with contextlib.suppress(OSError):
    socket.create_connection(("192.0.2.1", 443), timeout=1)
print("COUNTED", Path("/proc/net/snmp").read_text().replace(chr(10), chr(1)))
print("COUNTED6", Path("/proc/net/snmp6").read_text().replace(chr(10), chr(1)))
"""
"""Tries to connect, so that the counters are known to count."""

SCRIPT = """
import sys
from pathlib import Path
from semslam.cli import main
sys.argv = ["semslam", "run", "synthetic:room?frames=4&width=160", "--detector", "semantic", "--no-plots",
            "--set", "loops.worker=none", "--out", "run"]
try:
    main()
finally:
    print("COUNTED", Path("/proc/net/snmp").read_text().replace(chr(10), chr(1)))
    print("COUNTED6", Path("/proc/net/snmp6").read_text().replace(chr(10), chr(1)))
"""


def _sealed(*command: str) -> list[str]:
    return ["unshare", "--net", *command]


def _is_available() -> bool:
    if shutil.which("unshare") is None:
        return False
    return subprocess.run(_sealed("true"), capture_output=True, check=False).returncode == 0


def test_a_run_opens_no_connection_and_writes_nowhere_else(tmp_path: Path) -> None:
    if not _is_available():
        pytest.skip("network namespaces cannot be made here")
    home, work, cache = tmp_path / "home", tmp_path / "work", tmp_path / "cache"
    for folder in (home, work, cache):
        folder.mkdir()
    environment = {k: v for k, v in os.environ.items() if not k.startswith(("XDG_", "ORT_", "MPLCONFIG"))}
    environment |= {"HOME": str(home), "XDG_CACHE_HOME": str(cache), "TMPDIR": str(work), "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        _sealed(sys.executable, "-c", SCRIPT), env=environment, cwd=work, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert [path.name for path in work.iterdir()] == ["run"]
    assert not [path for path in home.rglob("*") if path.is_file()]
    assert not any(_counted(done.stdout).values())
    control = subprocess.run(_sealed(sys.executable, "-c", CONTROL), capture_output=True, text=True, check=True)
    assert any(_counted(control.stdout).values())


def _counted(text: str) -> dict[str, int]:
    """The kernel's counters by protocol and name."""
    found: dict[str, int] = {}
    first = next(line for line in text.splitlines() if line.startswith("COUNTED "))
    rows = first.removeprefix("COUNTED ").split("\x01")
    for heads, values in zip(rows[::2], rows[1::2], strict=False):
        protocol, *names = heads.split()
        for name, value in zip(names, values.split()[1:], strict=True):
            if name in COUNTERS:
                found[protocol + name] = int(value)
    second = next(line for line in text.splitlines() if line.startswith("COUNTED6 "))
    for row in second.removeprefix("COUNTED6 ").split("\x01"):
        name, _, value = row.partition(" ")
        if name.strip() in ("Ip6OutNoRoutes", "Udp6OutDatagrams"):
            found[name.strip()] = int(value)
    return found
