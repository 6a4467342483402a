"""Settings: defaults, files, overrides, mistakes."""

from pathlib import Path

import pytest

from semslam import plugins
from semslam.config import Config, load_config, load_saved_config, parse_overrides
from semslam.errors import ConfigError, SemslamWarning
from semslam.loop.detectors.semantic.settings import SemanticConfig


def test_a_dump_reads_back_the_same(tmp_path: Path) -> None:
    config = load_config(None, {"odometry": "dense", "loops": {"min_gap": 3.5}})
    file = tmp_path / "config.yaml"
    file.write_text(config.dump())
    assert load_config(file) == config


def test_overrides_reach_nested_sections_and_leave_the_rest() -> None:
    config = load_config(None, parse_overrides(["keyframes.interval=0.5", "detector=none"]))
    assert (config.keyframes.interval, config.detector) == (0.5, "none")
    assert config.keyframes.max_rotation == Config().keyframes.max_rotation


def test_a_setting_leaves_those_beside_it_as_they_are() -> None:
    config = load_config(None, parse_overrides(["verification.keypoints.levels=6", "semantic.nodes.cluster_size=4"]))
    assert config.verification.keypoints == Config().verification.keypoints.model_copy(update={"levels": 6})
    nodes = config.section("semantic", SemanticConfig).nodes
    assert nodes == SemanticConfig().nodes.model_copy(update={"cluster_size": 4})


def test_saved_settings_that_are_gone_are_left_out_with_a_warning(tmp_path: Path) -> None:
    file = tmp_path / "config.yaml"
    file.write_text("seed: 3\nold: {a: 1}\nloops: {min_gap: 2.5, limit: 4}\n")
    with pytest.warns(SemslamWarning, match=r"another version.*: loops\.limit, old\.$"):
        config = load_saved_config(file)
    assert config == load_config(None, {"seed": 3, "loops": {"min_gap": 2.5}})
    file.write_text("loops: {min_gap: -1, limit: 4}\n")
    with pytest.warns(SemslamWarning), pytest.raises(ConfigError, match=r"loops\.min_gap"):
        load_saved_config(file)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("loops.gap=1", "loops.gap"),
        ("loops.min_gap=-1", "loops.min_gap"),
        ("loops=3", "loops"),
        ("detector", "section.key=value"),
        ("detector=[", "not readable"),
    ],
)
def test_a_wrong_setting_is_named(text: str, sentence: str) -> None:
    with pytest.raises(ConfigError, match=sentence):
        load_config(None, parse_overrides([text]))


@pytest.mark.parametrize("content", ["- 1\n- 2\n", "a: [", "\x00\x01", "nonsense: 1"])
def test_a_damaged_file_is_one_sentence(tmp_path: Path, content: str) -> None:
    file = tmp_path / "bad.yaml"
    file.write_text(content)
    with pytest.raises(ConfigError) as caught:
        load_config(file)
    assert "\n" not in str(caught.value)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="nowhere"):
        load_config(tmp_path / "nowhere.yaml")


@pytest.mark.parametrize("group", list(plugins.GROUPS))
def test_every_registered_name_loads(group: str) -> None:
    for name in plugins.names(group):
        assert callable(plugins.load(group, name))


def test_an_unknown_name_lists_the_known_ones() -> None:
    with pytest.raises(ConfigError, match="Did you mean 'semantic'") as caught:
        plugins.load("semslam.detectors", "semantik")
    assert all(name in str(caught.value) for name in plugins.DETECTORS)
