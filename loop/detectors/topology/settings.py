"""Settings of the detector "topology", with the readings that its description leaves open."""

from enum import StrEnum

from semslam.config import Section, setting
from semslam.loop.detectors.semantic.settings import CentreReading, NodeConfig, ShareReading


class RelationReading(StrEnum):
    """What the relative position of two nodes is: left or right with above or below, or one of eight directions."""

    AXES = "axes"
    SECTORS = "sectors"


class TopologyConfig(Section):
    """Which nodes are related, how, and how many relations in common make a candidate."""

    nodes: NodeConfig = NodeConfig(min_area=0.01, centre=CentreReading.BOX)
    relation: RelationReading = setting(RelationReading.AXES, "what the relative position of two nodes is")
    level: float = setting(0.05, "offset up to which nodes are level, as a share of the larger image side", ge=0)
    use_depth: bool = setting(False, "whether in front or behind is part of a relation")
    depth_level: float = setting(0.3, "difference in depth up to which nodes are equally far", unit="m", ge=0)
    neighbours: int = setting(0, "number of nearest nodes that a node is related to; 0 = all", ge=0)
    count_nodes: bool = setting(True, "count nodes in common beside relations in common")
    share: ShareReading = setting(ShareReading.DICE, "what the count of common relations is divided by")
    min_share: float = setting(0.35, "share of common relations that makes a candidate", ge=0, le=1)
