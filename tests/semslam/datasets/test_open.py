"""Opening a sequence by its path."""

import subprocess
import sys
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest

from semslam import plugins
from semslam.config import DatasetConfig
from semslam.datasets import guess_loader, open_dataset
from semslam.errors import ConfigError, DatasetError


def test_a_path_that_does_not_exist_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match="There is no folder or file"):
        open_dataset(tmp_path / "nowhere")


def test_a_path_that_the_system_refuses_is_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match="cannot be read: File name too long"):
        open_dataset(tmp_path / ("x" * 5000))


def test_a_path_that_is_no_sequence_says_what_was_looked_for(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("hello")
    for path in (tmp_path, tmp_path / "notes.txt"):
        with pytest.raises(DatasetError, match=r"is no sequence: looked for .*rgb\.txt") as caught:
            open_dataset(path)
        message = str(caught.value)
        assert all(word in message for word in ("frame-000000.color.png", "color/", ".bag"))
        assert "\n" not in message


def test_an_unknown_loader_is_refused_with_the_known_ones(tmp_path: Path) -> None:
    for call in ({"loader": "tun"}, {"config": DatasetConfig(loader="tun")}):
        with pytest.raises(ConfigError, match="Did you mean 'tum'"):
            open_dataset(tmp_path, **call)  # type: ignore[arg-type]


def test_synthetic_is_a_name_unless_it_is_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert guess_loader("synthetic") == guess_loader("synthetic:house?seed=1") == "synthetic"
    (tmp_path / "synthetic").mkdir()
    (tmp_path / "synthetic" / "rgb.txt").touch()
    assert guess_loader("synthetic") == "tum"


def test_a_named_loader_is_not_second_guessed(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match="has no color/"):
        open_dataset(tmp_path, loader="folder")


def test_opening_is_light() -> None:
    code = (
        "import sys, semslam.datasets as d\n"
        "try: d.open_dataset('/')\n"
        "except d.DatasetError: pass\n"
        "heavy = {'torch', 'open3d', 'gtsam', 'rosbags', 'sklearn'} & set(sys.modules)\n"
        "assert not heavy, heavy\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=120)


def test_a_broken_plugin_does_not_keep_the_others_from_being_asked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    broken = EntryPoint(name="broken", value="no_such_module:Loader", group="semslam.datasets")
    monkeypatch.setattr(plugins, "entry_points", lambda group: [broken])
    with pytest.warns(UserWarning, match="no_such_module"), pytest.raises(DatasetError, match="is no sequence"):
        open_dataset(tmp_path)
