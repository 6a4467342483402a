"""Settings printed with what they mean, and their JSON schema."""

from pathlib import Path

import pytest
import yaml

from semslam.config import Config, load_config
from semslam.config.explained import commented_yaml, json_schema
from semslam.errors import ConfigError

CHANGED = Config().with_changes(keyframes={"interval": 0.5}, semantic={"nodes": {"min_area": 0.02}})


def test_the_comments_change_nothing(tmp_path: Path) -> None:
    file = tmp_path / "settings.yaml"
    file.write_text(commented_yaml(CHANGED))
    assert yaml.safe_load(file.read_text()) == CHANGED.nested()
    assert load_config(file) == CHANGED


def test_a_line_holds_value_description_unit_range_and_default() -> None:
    lines = [line.strip() for line in commented_yaml(CHANGED, "keyframes").splitlines()]
    assert "interval: 0.5  # time between keyframes; s; > 0; default 0.33" in lines


def test_choices_are_listed() -> None:
    assert "one of point_to_plane, generalized, colored" in commented_yaml(Config(), "verification.icp")
    assert "one of centroid, median" in commented_yaml(Config(), "semantic.nodes.depth")


def test_every_setting_is_described() -> None:
    lines = commented_yaml(Config()).splitlines()
    assert len(lines) > 150
    for line in lines:
        assert "  # " in line
        assert not line.split("  # ")[1].startswith("default"), line


def test_a_default_is_that_of_its_place() -> None:
    assert "default 2000" in commented_yaml(Config(), "verification.keypoints.count")
    assert "default 1000" in commented_yaml(Config(), "keypoints.count")


def test_a_place_is_printed_alone_with_the_headings_above_it() -> None:
    assert yaml.safe_load(commented_yaml(CHANGED, "semantic.nodes.min_area")) == {
        "semantic": {"nodes": {"min_area": 0.02}}
    }


@pytest.mark.parametrize(("place", "known"), [("nonsense", "keyframes"), ("keyframes.nonsense", "interval")])
def test_an_unknown_place_lists_the_known_ones(place: str, known: str) -> None:
    with pytest.raises(ConfigError, match=known):
        commented_yaml(Config(), place)
    with pytest.raises(ConfigError, match="holds no others"):
        commented_yaml(Config(), "keyframes.interval.more")


def test_the_schema_knows_every_section_units_and_limits() -> None:
    schema = json_schema(Config())
    assert set(schema["properties"]) == set(Config().nested())
    assert schema["additionalProperties"] is False
    interval = schema["$defs"]["KeyframeConfig"]["properties"]["interval"]
    assert interval == {
        "default": 0.33, "description": "time between keyframes", "exclusiveMinimum": 0, "title": "Interval",
        "type": "number", "unit": "s",
    }  # fmt: skip


def test_an_outside_implementation_is_explained_like_our_own(example_plugin: str) -> None:
    assert "bins of the histogram" in commented_yaml(Config(), example_plugin)
    assert example_plugin in json_schema(Config())["properties"]
