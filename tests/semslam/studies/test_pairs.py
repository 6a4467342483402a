"""semslam pairs: the test of the paper's Table 2 from the command line, on folders and on a rendered room."""

import csv
import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from semslam.config import Config
from semslam.errors import ConfigError, DatasetError
from semslam.eval.pairs.judging import PairGroup
from semslam.studies.pairs import PairPlan, sequence_pairs, try_pairs
from tests.conftest import Call

CAMERA = "width: 160\nheight: 120\nfx: 130\nfy: 130\ncx: 80\ncy: 60\n"
ROOM = "synthetic:room?width=64&rate=2"


def write_pairs(folder: Path, seed: int, places: int = 3) -> Path:
    """Pictures of a few places, twice each; the second time a little brighter."""
    folder.mkdir()
    rng = np.random.default_rng(seed)
    rows = ["first,second,same,group"]
    for place in range(places):
        picture = cv2.resize(rng.integers(0, 200, (6, 8, 3), dtype=np.uint8), (160, 120))
        cv2.imwrite(str(folder / f"{place}.png"), picture)
        cv2.imwrite(str(folder / f"{place}-again.png"), picture + 20)
        for group in PairGroup:
            rows += [f"{place}.png,{place}-again.png,1,{group}", f"{place}.png,{(place + 1) % places}.png,0,{group}"]
    (folder / "pairs.csv").write_text("\n".join(rows))
    (folder / "camera.yaml").write_text(CAMERA)
    return folder


def test_pairs_json_keeps_its_contract(semslam: Call, tmp_path: Path) -> None:
    a, b = write_pairs(tmp_path / "a", 0), write_pairs(tmp_path / "b", 1)
    out = tmp_path / "out"
    outcome = semslam("pairs", "--folder", a, "--folder", b, "--detectors", "thumbnail,hog", "--out", out)
    assert outcome.code == 0, outcome.err
    written = json.loads((out / "pairs.json").read_text())
    again = semslam("pairs", "--folder", a, "--folder", b, "--detectors", "thumbnail,hog", "--out", out, "--json")
    assert json.loads(again.out) == written
    assert list(written) == ["detectors"]
    assert [row["detector"] for row in written["detectors"]] == ["thumbnail", "hog"]
    for row in written["detectors"]:
        assert set(row) == {"detector", "groups"}
        assert list(row["groups"]) == ["viewpoint", "illumination", "objects"]
        assert all(group == {"accuracy": 1.0, "pairs": 12} for group in row["groups"].values())
    with (out / "pairs.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 2 * 36
    assert all((float(row["score"]) >= float(row["threshold"])) == (row["same"] == "1") for row in rows)
    kinds = (out / "kinds.csv").read_text().splitlines()
    assert kinds[0] == "kind,pairs,thumbnail,hog"
    assert '"hard negatives, objects",6,1.0000,1.0000' in kinds
    assert [(out / f"pairs-{n}.png").read_bytes()[:4] for n in (1, 2)] == [b"\x89PNG"] * 2
    assert "Thresholds from the other sets" in outcome.out


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ((), "Name a sequence or a folder"),
        (("/nowhere",), "no folder or file"),
        (("a", "a"), "only once"),
        (("synthetic:castle",), "castle"),
        (("--folder", "/nowhere"), "pairs.csv cannot be read"),
        (("synthetic:room", "--detectors", "none"), "proposes nothing"),
        (("synthetic:room", "--detectors", "eyes"), "no loop detector 'eyes'"),
        (("synthetic:room", "--set", "segmentation.name=folder"), "has no labels for frames"),
    ],
)
def test_a_mistake_is_one_sentence(semslam: Call, tmp_path: Path, arguments: tuple[str, ...], sentence: str) -> None:
    outcome = semslam("pairs", *arguments, "--out", tmp_path / "out")
    assert outcome.code == 2
    assert len(outcome.err.strip().splitlines()) == 1
    assert sentence in outcome.err
    assert not (tmp_path / "out").exists()


def test_an_empty_list_gives_no_pairs(tmp_path: Path) -> None:
    folder = write_pairs(tmp_path / "a", 0, places=0)
    with pytest.raises(DatasetError, match="gives no pairs"):
        try_pairs(PairPlan((), (folder,)), Config(), ["thumbnail"])


def test_one_set_takes_its_threshold_from_the_rendered_house() -> None:
    assert PairPlan(("a",)).tuning_sequences == ("synthetic:house",)
    assert PairPlan(("a",), tuning=("c",)).tuning_sequences == ("c",)
    assert PairPlan(("a", "b")).tuning_sequences == ()


def test_in_a_rendered_room_light_and_things_change_for_real() -> None:
    name, pairs = sequence_pairs(ROOM, Config(), every=1, count=8)
    assert name == "synthetic-room"
    kinds = {group: {pair.kind for pair in pairs if pair.group is group} for group in PairGroup}
    assert kinds[PairGroup.OBJECTS] == {"things moved"}
    assert kinds[PairGroup.ILLUMINATION] <= {"dim light", "bright light", "evening light", "cool light"}
    for pair in pairs:
        first, second = pair.load(0), pair.load(1)
        assert first.color.shape == second.color.shape == (48, 64, 3)
    same = [pair.same_place for pair in pairs]
    assert sum(same) == len(same) / 2


def test_a_label_folder_cannot_serve(tmp_path: Path) -> None:
    config = Config().with_changes(segmentation={"name": "folder"})
    with pytest.raises(ConfigError, match="no labels for frames"):
        try_pairs(PairPlan((ROOM,)), config, ["thumbnail"])
