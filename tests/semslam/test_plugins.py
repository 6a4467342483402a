"""Parts from outside are held against their role before a run, and by ``semslam doctor``."""

import inspect
import subprocess
import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path

import pytest

from semslam import plugins
from semslam.config import Config
from semslam.config.settings import check_plugin
from semslam.errors import ConfigError
from tests.conftest import Call

DETECTOR = """
from semslam.config import Section, setting

class Detector:
    name = "outside"
    needs_labels = False

    @classmethod
    def from_config(cls, config):
        return cls()

    def query(self, view):
        return []

    def add(self, view):
        pass
"""
Install = Callable[[str], None]


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Install:
    """Put a detector called "outside" where it is found as if it were installed."""
    info = tmp_path / "outside-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: outside\nVersion: 1.0\n")
    module = f"outside_{tmp_path.name.replace('-', '_')}"
    (info / "entry_points.txt").write_text(f"[semslam.detectors]\noutside = {module}:Detector\n")
    monkeypatch.syspath_prepend(str(tmp_path))

    def write(code: str) -> None:
        (tmp_path / f"{module}.py").write_text(code)

    return write


BROKEN = {
    "does not import: ZeroDivisionError": "1 / 0",
    "does not import: SystemExit": "raise SystemExit(0)",
    "does not import: AttributeError": "",
    "it is no class": "Detector = 5",
    "it has no 'add'": DETECTOR.replace("def add", "def put"),
    "it has no 'needs_labels'": DETECTOR.replace("needs_labels", "labels"),
    "'query' does not take 1 argument": DETECTOR.replace("query(self, view)", "query(self)"),
    "its name is 'other', not 'outside'": DETECTOR.replace('"outside"', '"other"'),
    "unusable Settings": DETECTOR + "    Settings = dict\n",
    "unusable Settings: ValidationError": DETECTOR.replace(
        "class Detector", "class S(Section):\n    bins: int\n\nclass Detector"
    )
    + "    Settings = S\n",
}


@pytest.mark.parametrize("reason", BROKEN)
def test_a_plugin_that_lacks_something_is_one_sentence_before_the_first_frame(
    semslam: Call, install: Install, reason: str
) -> None:
    install(BROKEN[reason])
    outcome = semslam("run", "/nowhere", "--detector", "outside")
    assert outcome.code == 2
    assert reason in outcome.err
    assert len(outcome.err.strip().splitlines()) == 1
    with pytest.raises(ConfigError, match="plug-in 'outside'"):
        check_plugin("semslam.detectors", "outside")


def test_doctor_names_what_is_wrong_with_a_plugin(semslam: Call, install: Install) -> None:
    install("1 / 0")
    outcome = semslam("doctor")
    assert outcome.code == 2
    assert "Not usable here" in outcome.err
    assert "plug-in outside" in outcome.err
    assert "division by zero" in outcome.out


def test_doctor_passes_a_usable_plugin(semslam: Call, example_plugin: str) -> None:
    assert f"plug-in {example_plugin} (semslam_colours:ColourDetector): usable" in semslam("doctor").out


def test_a_broken_plugin_does_not_stop_a_run_without_it(semslam: Call, install: Install, tmp_path: Path) -> None:
    install("1 / 0")
    small = ("synthetic:room?frames=3", "--set", "keypoints.count=200", "--detector", "none", "--no-plots")
    outcome = semslam("run", *small, "--out", tmp_path / "run")
    assert outcome.code == 0, outcome.err


def test_a_plugin_that_cannot_be_built_is_one_sentence(semslam: Call, install: Install, tmp_path: Path) -> None:
    install(DETECTOR.replace("return cls()", "raise KeyError('weights')"))
    outcome = semslam("run", "synthetic:room?frames=3", "--detector", "outside", "--out", tmp_path / "run")
    assert outcome.code == 2
    assert outcome.err.strip() == "semslam: KeyError: 'weights'."


@pytest.mark.parametrize("group", plugins.GROUPS)
def test_what_a_role_asks_for_is_in_its_protocol_and_in_every_implementation_of_ours(group: plugins.Group) -> None:
    protocols = {
        "semslam.odometry": "semslam.frontend.odometry:Odometry",
        "semslam.detectors": "semslam.loop.detector:LoopDetector",
        "semslam.segmenters": "semslam.loop.segmentation.segmenter:Segmenter",
        "semslam.verifiers": "semslam.loop.verification.verifier:LoopVerifier",
        "semslam.robust": "semslam.backend.robust.strategy:RobustStrategy",
        "semslam.datasets": "semslam.datasets.dataset:DatasetLoader",
    }
    module, _, name = protocols[group].partition(":")
    protocol = getattr(import_module(module), name)
    role = plugins.ROLES[group]
    ours = {key for key, value in vars(protocol).items() if inspect.isfunction(value) and not key.startswith("_")}
    assert ours <= set(role.methods)
    for method, count in role.methods.items():
        assert plugins._takes(protocol, method, count), method
    for known in plugins.GROUPS[group]:
        assert plugins._lacks(role, known, plugins.load(group, known)) is None, known
        assert plugins.declared_settings(group, known) is vars(plugins.load(group, known)).get("Settings"), known


def test_listing_settings_imports_nothing_that_runs_a_network() -> None:
    listed = "import sys, semslam.config; semslam.config.Config().dump(); print('onnx' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", listed], capture_output=True, check=True).stdout.strip() == b"False"


def test_names_that_settings_choose_are_checked(install: Install) -> None:
    install(DETECTOR)
    assert Config().with_changes(detector="outside").detector == "outside"
