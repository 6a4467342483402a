"""Settings of the detector "subgraph", with the readings that its description leaves open."""

from enum import StrEnum

from semslam.config import Section, setting
from semslam.loop.detectors.semantic.settings import CentreReading, NodeConfig


class NodeReading(StrEnum):
    """What the similarity of two nodes of one class is: 1, or the ratio of the smaller to the larger size in metres."""

    LABEL = "label"
    SIZE = "size"


class EdgeReading(StrEnum):
    """What two edges are compared by: their length in space, or how one end is displaced from the other."""

    LENGTH = "length"
    OFFSET = "offset"


class SubgraphConfig(Section):
    """What a subgraph holds, how nodes and edges are compared, and from which score on a pair is proposed."""

    nodes: NodeConfig = NodeConfig(min_area=0.01, centre=CentreReading.BOX, keep_without_depth=False)
    max_nodes: int = setting(12, "maximum number of nodes of a subgraph, the largest kept", gt=0, le=64)
    node: NodeReading = setting(NodeReading.SIZE, "similarity of two nodes of one class")
    edge: EdgeReading = setting(EdgeReading.LENGTH, "what two edges are compared by")
    tolerance: float = setting(0.3, "standard deviation of the difference of two edges", unit="m", gt=0)
    edge_weight: float = setting(0.5, "weight of the edge similarity in the global similarity", ge=0, le=1)
    min_score: float = setting(0.42, "global similarity that makes a candidate", ge=0, le=1)
