"""Settings of the loop detectors, with the readings that the paper leaves open."""

from enum import StrEnum
from pathlib import Path
from typing import Literal

from pydantic import Field

from semslam.config.section import Section


class LoopConfig(Section):
    """What holds for every detector."""

    min_gap: float = Field(5.0, ge=0, description="seconds that must lie between the frames of a loop")
    max_candidates: int = Field(5, gt=0, description="candidates a query may hand to the verification")
    follow: int = Field(3, ge=0, description="further keyframes that a known place lets each keyframe try; 0 = none")
    min_score: float | None = Field(None, ge=0, le=1, description="score of a candidate; none = the detector's own")


class ShareReading(StrEnum):
    """What a count of common things is divided by; the paper's formulas (1) and (3) leave it open."""

    DICE = "dice"
    LARGER = "larger"
    UNION = "union"
    QUERY = "query"


class DepthReading(StrEnum):
    """Which depth a mask block's node gets: that of the centroid's pixel (the paper), or the block's median."""

    CENTROID = "centroid"
    MEDIAN = "median"


class DepthUnit(StrEnum):
    """The unit of depth beside u and v in pixels; raw is the TUM format's 5000 a metre."""

    METRE = "m"
    CENTIMETRE = "cm"
    MILLIMETRE = "mm"
    RAW = "raw"

    @property
    def per_metre(self) -> float:
        """How many of the unit make a metre."""
        return {"m": 1.0, "cm": 100.0, "mm": 1000.0, "raw": 5000.0}[self.value]


class DistanceReading(StrEnum):
    """Between what the Euclidean distance of two nodes is taken: (u, v), or (u, v, depth)."""

    IMAGE = "image"
    IMAGE_DEPTH = "image_depth"


class MatchReading(StrEnum):
    """Which similar nodes are counted: each node once (mutually nearest), or every node that has a partner."""

    ONE_TO_ONE = "one_to_one"
    ANY_PARTNER = "any_partner"


class NodeConfig(Section):
    """Semantic nodes (paper, section 3.1). Lengths in pixels are for a larger image side of 640 and scale with it."""

    connectivity: Literal[4, 8] = Field(8, description="neighbours that join pixels of a label to a block")
    min_area: float = Field(0.0, ge=0, lt=1, description="share of the image below which a block is left out")
    depth: DepthReading = Field(DepthReading.CENTROID, description="which depth a block gets")
    keep_without_depth: bool = Field(True, description="keep nodes without depth, at depth 0")
    cluster_radius: float = Field(40.0, ge=0, description="pixels; DBSCAN's eps among nodes of a label; 0 = off")
    cluster_size: int = Field(3, ge=2, description="DBSCAN's least number of nodes ('greater than 2')")


class SemanticConfig(Section):
    """The paper's detector (section 3.2) with thresholds that forgive a moved camera; the verification decides."""

    nodes: NodeConfig = NodeConfig(min_area=0.01)
    min_label_share: float = Field(0.0, ge=0, le=1, description="share of common labels, formula (1); 0 = no gate")
    label_share: ShareReading = Field(ShareReading.DICE, description="what the count of common labels is divided by")
    min_cosine: float = Field(-1.0, ge=-1, le=1, description="cosine of (u, v, depth), formula (2); -1 = no test")
    cosine_depth: DepthUnit = Field(DepthUnit.MILLIMETRE, description="unit of depth in the cosine")
    max_distance: float = Field(0.1, gt=0, description="node distance as a share of the larger image side")
    distance: DistanceReading = Field(DistanceReading.IMAGE, description="what the node distance is taken between")
    matching: MatchReading = Field(MatchReading.ONE_TO_ONE, description="which similar nodes are counted")
    min_node_share: float = Field(0.1, ge=0, le=1, description="share of similar nodes that makes a candidate")
    node_share: ShareReading = Field(ShareReading.DICE, description="what the count of similar nodes is divided by")


class PaperSemanticConfig(SemanticConfig):
    """The paper's detector with the paper's thresholds (section 4.3)."""

    nodes: NodeConfig = NodeConfig()
    min_label_share: float = Field(0.8, ge=0, le=1, description="share of common labels, formula (1)")
    min_cosine: float = Field(0.999, ge=-1, le=1, description="cosine of (u, v, depth), formula (2)")
    max_distance: float = Field(0.025, gt=0, description="node distance as a share of the larger image side")
    min_node_share: float = Field(0.75, ge=0, le=1, description="share of similar nodes, formula (3)")


class DbowConfig(Section):
    """Bags of binary words."""

    group: float = Field(0.35, ge=0, description="seconds; keyframes this near are scored together")
    min_score: float = Field(0.04, ge=0, le=1, description="score of a candidate")


class FusedConfig(Section):
    """Whole image, words and classes joined."""

    min_probability: float = Field(0.5, ge=0, le=1, description="probability of the same place that makes a candidate")
    word_share: float = Field(0.4, ge=0, lt=1, description="share of the candidates that are the best by words")
    min_word_probability: float = Field(0.05, ge=0, le=1, description="probability that those need")


class Conv3Config(Section):
    """Flattened convolutional features."""

    alexnet: Path | None = Field(None, description="torchvision's AlexNet weights; none = the shipped encoder")
