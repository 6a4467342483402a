"""Loop detection from subgraphs of objects with depth, after Cao et al. (Li et al. 2022, section 2)."""

from typing import Self

import numpy as np

from semslam.config import Config, LoopConfig
from semslam.loop.detector import Arrays
from semslam.loop.detectors.common.labels import labels_of
from semslam.loop.detectors.common.remembering import RememberingDetector
from semslam.loop.detectors.semantic.nodes import extract_nodes, nodes_of_arrays, nodes_to_arrays
from semslam.loop.detectors.subgraph.graph import Subgraph, build_subgraph
from semslam.loop.detectors.subgraph.settings import SubgraphConfig
from semslam.loop.detectors.subgraph.similarity import SubgraphIndex
from semslam.types import KeyframeView, LoopCandidate, LoopEvidence


class SubgraphDetector(RememberingDetector[Subgraph]):
    """Node similarity and edge similarity of object subgraphs, combined to a global similarity.

    Nodes are the boxes of segmented components in place of detected objects, each placed in space by the depth at its
    centre, and joined to all others. What the description leaves open is a setting.
    """

    name = "subgraph"
    needs_labels = True
    Settings = SubgraphConfig

    def __init__(self, config: SubgraphConfig, loops: LoopConfig) -> None:
        super().__init__(loops, config.min_score)
        self._config = config
        self._clear()

    @classmethod
    def from_config(cls, config: Config) -> Self:
        """Take the sections ``subgraph`` and ``loops``."""
        return cls(config.section(cls.name, cls.Settings), config.loops)

    def query(self, view: KeyframeView) -> list[LoopCandidate]:
        """Candidates by global similarity, with the labels in common.

        Raises:
            ConfigError: the view holds no labels.
        """
        graph = self._look(view)
        scores = self._index.scores(graph)
        names = labels_of(view, self.name).names
        return [
            LoopCandidate(
                view.keyframe.id, self._timeline.id_at(at), float(scores[at]), self.name,
                LoopEvidence(
                    tuple(names[i] for i in np.intersect1d(graph.nodes.labels, self._looks[at].nodes.labels)),
                    figures={"similarity": float(scores[at])},
                ),
            )
            for at in self._timeline.best(view.keyframe, scores)
        ]  # fmt: skip

    def _describe(self, view: KeyframeView) -> Subgraph:
        nodes = extract_nodes(labels_of(view, self.name), view.depth, self._config.nodes)
        return build_subgraph(nodes, view.keyframe.intrinsics, self._config.max_nodes)

    def _clear(self) -> None:
        self._index = SubgraphIndex(self._config)

    def _enter(self, look: Subgraph) -> None:
        self._index.add(look)

    def _to_arrays(self, look: Subgraph) -> Arrays:
        return {**nodes_to_arrays(look.nodes), "points": look.points, "sizes": look.sizes}

    def _from_arrays(self, arrays: Arrays) -> Subgraph:
        nodes = nodes_of_arrays(arrays)
        points, sizes = np.asarray(arrays["points"], np.float64), np.asarray(arrays["sizes"], np.float64)
        if points.shape != (len(nodes), 3) or sizes.shape != (len(nodes),) or len(nodes) > self._config.max_nodes:
            raise ValueError("no subgraph")
        return Subgraph(nodes, points, sizes)
