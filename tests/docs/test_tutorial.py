"""The tutorial's commands, run as they stand in the page."""

import os
import re
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

PAGE = Path(__file__).resolve().parents[2] / "docs" / "tutorial.md"
BLOCK = re.compile(
    r"(?:^<!-- (?P<mark>[^\n]*) -->\n)?^```(?P<language>\w+)\n(?P<text>.*?)^```$", re.MULTILINE | re.DOTALL
)


@dataclass(frozen=True)
class Block:
    """A fenced block, and the comment above it: ``not run: REASON`` or ``file: NAME``."""

    mark: str
    language: str
    text: str


def blocks() -> list[Block]:
    found = BLOCK.finditer(PAGE.read_text(encoding="utf-8"))
    return [Block(one["mark"] or "", one["language"], one["text"]) for one in found]


def test_the_commands_work_in_their_order(tmp_path: Path) -> None:
    scripts = Path(sys.executable).parent
    environment = os.environ | {"PATH": f"{scripts}{os.pathsep}{os.environ['PATH']}", "OMP_NUM_THREADS": "1"}
    ran = []
    for block in blocks():
        if block.mark.startswith("file: "):
            (tmp_path / block.mark.removeprefix("file: ")).write_text(block.text)
        elif block.language == "sh" and not block.mark.startswith("not run: "):
            command = ["bash", "-euo", "pipefail", "-c", block.text]
            done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
            assert done.returncode == 0, f"{block.text}{done.stdout[-2000:]}{done.stderr[-2000:]}"
            ran.append(block.text)
    assert len(ran) >= 6
    assert (tmp_path / "bench" / "results.tex").read_text().count("\\\\") > 2
    assert list((tmp_path / "figures").glob("*.pdf"))


def test_what_is_not_run_is_installation_and_downloads() -> None:
    left_out = [block.text for block in blocks() if block.mark.startswith("not run: ")]
    assert len(left_out) == 2
    assert any("pip install" in text for text in left_out)
    assert any("semslam download" in text for text in left_out)
