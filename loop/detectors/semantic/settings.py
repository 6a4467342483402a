"""Settings of the semantic detectors, with the readings that the paper leaves open."""

from enum import StrEnum
from typing import Literal

from semslam.config import Section, setting


class ShareReading(StrEnum):
    """The denominator of a share of common labels or nodes; the paper's formulas (1) and (3) leave it open."""

    DICE = "dice"
    LARGER = "larger"
    UNION = "union"
    QUERY = "query"


class DepthReading(StrEnum):
    """Which depth a connected component's node gets: that of the node's pixel (the paper), or the median."""

    CENTROID = "centroid"
    MEDIAN = "median"


class CentreReading(StrEnum):
    """Which point of a connected component is its node: its centroid (the paper), or the centre of its box."""

    CENTROID = "centroid"
    BOX = "box"


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
    """Which similar nodes are counted: each node once (mutual nearest neighbours), or every node that has a partner."""

    ONE_TO_ONE = "one_to_one"
    ANY_PARTNER = "any_partner"


class NodeConfig(Section):
    """Semantic nodes (paper, section 3.1). Lengths in pixels are for a larger image side of 640 and scale with it."""

    connectivity: Literal[4, 8] = setting(8, "pixel neighbourhood of connected components")
    min_area: float = setting(0.0, "share of the image below which a component is left out", ge=0, lt=1)
    centre: CentreReading = setting(CentreReading.CENTROID, "which point of a component is its node")
    depth: DepthReading = setting(DepthReading.CENTROID, "which depth a component gets")
    keep_without_depth: bool = setting(True, "keep nodes without depth, at depth 0")
    cluster_radius: float = setting(40.0, "DBSCAN's eps among nodes of one label; 0 = no clustering", unit="px", ge=0)
    cluster_size: int = setting(3, "DBSCAN's minimum number of nodes of a cluster (the paper's 'greater than 2')", ge=2)


class SemanticConfig(Section):
    """The paper's detector (section 3.2) with thresholds that tolerate camera motion; the verification decides."""

    nodes: NodeConfig = NodeConfig(min_area=0.01)
    min_label_share: float = setting(0.0, "share of common labels, formula (1); 0 = no threshold", ge=0, le=1)
    label_share: ShareReading = setting(ShareReading.DICE, "what the count of common labels is divided by")
    min_cosine: float = setting(-1.0, "cosine of (u, v, depth), formula (2); -1 = no threshold", ge=-1, le=1)
    cosine_depth: DepthUnit = setting(DepthUnit.MILLIMETRE, "unit of depth in the cosine")
    max_distance: float = setting(0.1, "node distance as a share of the larger image side", gt=0)
    distance: DistanceReading = setting(DistanceReading.IMAGE, "space in which the node distance is taken")
    matching: MatchReading = setting(MatchReading.ONE_TO_ONE, "which similar nodes are counted")
    min_node_share: float = setting(0.1, "share of similar nodes that makes a candidate, formula (3)", ge=0, le=1)
    node_share: ShareReading = setting(ShareReading.DICE, "what the count of similar nodes is divided by")


class PaperSemanticConfig(SemanticConfig):
    """The paper's detector with the paper's thresholds (section 4.3)."""

    nodes: NodeConfig = NodeConfig()
    min_label_share: float = setting(0.8, "share of common labels, formula (1)", ge=0, le=1)
    min_cosine: float = setting(0.999, "cosine of (u, v, depth), formula (2)", ge=-1, le=1)
    max_distance: float = setting(0.025, "node distance as a share of the larger image side", gt=0)
    min_node_share: float = setting(0.75, "share of similar nodes that makes a candidate, formula (3)", ge=0, le=1)
