"""Settings: one small frozen model per stage, joined in ``Config``; read from YAML, overridden, dumped."""

from collections.abc import Mapping
from enum import StrEnum
from pathlib import Path
from typing import Any, Literal, Self, TypeVar

import yaml
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from semslam.errors import ConfigError

Interval = tuple[float, float]


class Section(BaseModel):
    """Base of all sections: frozen, and an unknown key is an error."""

    model_config = ConfigDict(frozen=True, extra="forbid")


class FaultConfig(Section):
    """Faults put into a sequence on purpose; intervals are (from, to) in seconds since its first frame."""

    drop: float = Field(0.0, ge=0, lt=1, description="share of frames left out at random")
    unreadable: float = Field(0.0, ge=0, lt=1, description="share of frames whose image cannot be read, at random")
    gaps: tuple[Interval, ...] = Field((), description="intervals without any frame")
    black: tuple[Interval, ...] = Field((), description="intervals of black colour images")
    no_depth: tuple[Interval, ...] = Field((), description="intervals without a single depth value")
    nan_depth: tuple[Interval, ...] = Field((), description="intervals in which half of the depth values are NaN")
    blur: tuple[Interval, ...] = Field((), description="intervals of strong motion blur")
    frozen: tuple[Interval, ...] = Field((), description="intervals in which the image before them is repeated")
    seed: int = Field(0, ge=0, description="seed of what is drawn at random")


class DatasetConfig(Section):
    """Which frames are read, and how. What is set here wins over camera.yaml, which wins over the folder's name."""

    loader: str | None = Field(None, description="registered loader; none = guessed from the path")
    camera: Path | None = Field(None, description="camera.yaml used in place of the sequence's own")
    depth_scale: float | None = Field(None, gt=0, description="units of the depth images per metre")
    association_window: float = Field(0.02, gt=0, description="seconds between a colour image and its depth image")
    fps: float = Field(30.0, gt=0, description="frames per second, where the sequence has no time stamps")
    register_depth: bool = Field(True, description="7-Scenes: warp raw depth into the colour camera")
    color_topic: str | None = Field(None, description="ROS bag: topic of the colour images; none = guessed")
    depth_topic: str | None = Field(None, description="ROS bag: topic of the depth images; none = guessed")
    start: int = Field(0, ge=0, description="frames left out at the beginning")
    max_frames: int | None = Field(None, gt=0, description="frames read at the most")
    stride: int = Field(1, gt=0, description="every n-th frame is read")
    faults: FaultConfig = FaultConfig()


class FeatureConfig(Section):
    """Keypoints and their matching, shared by the front end and the verification."""

    count: int = Field(1000, gt=0, description="keypoints per image at the most")
    levels: int = Field(8, gt=0, description="pyramid levels")
    scale: float = Field(1.2, gt=1, description="scale between levels")
    fast_threshold: int = Field(12, gt=0, description="FAST corner threshold")
    cell: int = Field(32, gt=0, description="pixels; side of the cells over which keypoints are spread")
    per_cell: int = Field(6, gt=0, description="keypoints a cell keeps")
    min_depth: float = Field(0.2, ge=0, description="metres; nearer depth is not used")
    max_depth: float = Field(6.0, gt=0, description="metres; farther depth is not used")


class KeyframeConfig(Section):
    """When a frame becomes a keyframe (paper, section 3.1.1: at a time interval), and what is kept of it."""

    interval: float = Field(0.33, gt=0, description="seconds between keyframes")
    max_translation: float = Field(0.3, gt=0, description="metres of motion that make one sooner")
    max_rotation: float = Field(0.35, gt=0, description="radians of motion that make one sooner")
    cloud_voxel: float = Field(0.04, gt=0, description="metres; grid that thins the stored cloud")
    max_depth: float = Field(6.0, gt=0, description="metres; farther points are not stored")


class FeatureOdometryConfig(Section):
    """Odometry from ORB matches and PnP, frame to frame."""

    min_inliers: int = Field(15, gt=5, description="matches that must agree on a motion")
    threshold_px: float = Field(3.0, gt=0, description="reprojection error up to which a match agrees")
    covariance_scale: float = Field(10.0, gt=0, description="factor that calibrates the covariance")


class FeatureMapConfig(Section):
    """Odometry against a map of landmarks."""

    levels: int = Field(4, gt=0, description="pyramid levels, in place of features.levels")
    scale: float = Field(1.44, gt=1, description="scale between levels, in place of features.scale")
    min_inliers: int = Field(15, gt=5, description="landmarks that must agree on a pose")
    sure_inliers: int = Field(40, gt=5, description="landmarks below which a pose is called degraded")
    min_landmarks: int = Field(50, gt=5, description="keypoints with depth that a keyframe must have")
    restart_seconds: float = Field(0.5, ge=0, description="a new map starts when good images meet none for so long")
    readout: float | None = Field(None, ge=0, description="seconds from first row to last; none = the camera's")
    readout_sigma: float = Field(0.005, ge=0, description="its uncertainty before it is estimated; 0 = known")
    radius: float = Field(15.0, gt=0, description="pixels around a landmark's predicted place that are searched")
    narrow_radius: float = Field(10.0, gt=0, description="the same once the pose is nearly known")
    local_keyframes: int = Field(15, gt=0, description="covisible keyframes whose landmarks are looked for")
    min_interval: float = Field(0.09, ge=0, description="seconds that lie between keyframes at the least")
    max_interval: float = Field(0.33, gt=0, description="seconds after which a keyframe is made in any case")
    max_translation: float = Field(0.1, gt=0, description="metres of motion that make one sooner")
    max_rotation: float = Field(0.15, gt=0, description="radians of motion that make one sooner")
    min_share: float = Field(0.5, gt=0, le=1, description="share of keypoints that must be landmarks")
    min_shared: int = Field(15, gt=0, description="landmarks that make two keyframes covisible")
    max_depth: float = Field(4.0, gt=0, description="metres; farther keypoints do not become landmarks")
    min_found: float = Field(0.25, ge=0, le=1, description="share of its views in which a landmark must be found")
    window: int = Field(6, gt=0, description="keyframes adjusted together")
    fixed: int = Field(6, ge=0, description="keyframes around them that hold them in place")
    adjustment_steps: int = Field(5, gt=0, description="steps of an adjustment, one a frame")
    covariance_scale: float = Field(50.0, gt=0, description="factor that calibrates the covariance")


class DenseConfig(Section):
    """Dense RGB-D odometry."""

    max_depth: float = Field(4.0, gt=0, description="metres; farther depth is not used")
    steps: tuple[int, ...] = Field((10, 5, 3), min_length=1, description="iterations, coarsest level first")
    min_coverage: float = Field(0.05, gt=0, le=1, description="share of pixels that must have depth")
    min_contrast: float = Field(4.0, ge=0, description="standard deviation of grey values that an image must have")
    min_fitness: float = Field(0.3, gt=0, le=1, description="share of pixels that must agree on a motion")
    keyframe_translation: float = Field(0.1, ge=0, description="metres after which dense_keyframe takes a new keyframe")
    keyframe_rotation: float = Field(0.15, ge=0, description="radians, the same")
    max_bridge: float = Field(0.2, gt=0, description="seconds between frames that may be bridged where features starve")
    sigma: float = Field(0.6, gt=0, description="metres; error of one pixel's depth that calibrates the covariance")


class KissConfig(Section):
    """KISS-ICP with a preset for depth cameras."""

    max_range: float = Field(4.0, gt=0, description="metres; farther points are not used")
    voxel: float = Field(0.05, gt=0, description="metres; voxel size of the local map")
    initial_threshold: float = Field(0.1, gt=0, description="metres; first association threshold")
    min_motion: float = Field(0.01, gt=0, description="metres; smaller deviations do not adapt the threshold")
    stride: int = Field(4, gt=0, description="every n-th pixel in both directions is used")
    min_points: int = Field(500, gt=10, description="points that a scan must have")
    max_surprise: float = Field(0.3, gt=0, description="metres between prediction and result that mean failure")
    max_surprise_rotation: float = Field(0.5, gt=0, description="radians, the same")
    sigma: float = Field(0.15, gt=0, description="metres; error of one point that calibrates the covariance")


class SegmentationConfig(Section):
    """Which segmenter runs, and how."""

    name: str = Field("onnx", description="registered segmenter")
    weights: Path | None = Field(None, description="checkpoint; none = the shipped one")
    width: int = Field(320, gt=0, description="input width in pixels")
    height: int = Field(240, gt=0, description="input height in pixels")
    threads: int = Field(1, gt=0, description="inference threads")
    precision: Literal["int8", "float32"] = Field("int8", description="arithmetic of the shipped network")
    min_confidence: float = Field(0.0, ge=0, lt=1, description="below it a pixel becomes void; 0 = never")
    labels_dir: Path | None = Field(None, description="folder of label images for the segmenter 'folder'")
    cache_dir: Path | None = Field(None, description="where segmentations are cached by content; none = no cache")


class TrainingConfig(Section):
    """How the segmentation network is trained; the size of its input is the segmenter's."""

    start: Path | None = Field(None, description="weights to start from: ADE20K state dict or own checkpoint")
    epochs: int = Field(60, gt=0, description="passes over the labelled photos")
    batch: int = Field(8, gt=1, description="views in one step")
    rate: float = Field(1e-3, gt=0, description="peak learning rate of decoder and head")
    encoder_rate: float = Field(0.25, ge=0, description="learning rate of the encoder as a share of the peak")
    weight_decay: float = Field(0.02, ge=0, description="decoupled weight decay")
    freeze_early: bool = Field(False, description="leave the encoder's stem and first blocks, to 1/4, as they are")
    freeze_norms: bool = Field(False, description="keep the batch norms' statistics as they were at the start")
    warmup: float = Field(0.08, ge=0, lt=1, description="share of the steps in which the rate climbs")
    average: float = Field(0.998, ge=0, lt=1, description="decay of the weight average that is kept")
    strong_share: float = Field(0.0, ge=0, le=1, description="share of views taken close, rolled, blurred, badly lit")
    rare_share: float = Field(0.0, ge=0, le=1, description="share of views drawn by class, every class as often")
    unlabelled: Path | None = Field(None, description="folder of photos without labels, for teachers to judge")
    teachers: tuple[Path, ...] = Field((), description="weights of the networks that judge them together")
    unlabelled_share: float = Field(0.4, ge=0, lt=1, description="share of views drawn from those photos")
    threads: int = Field(1, gt=0, description="training threads")
    save_every: float = Field(60.0, gt=0, description="seconds between checkpoints")


class LoopConfig(Section):
    """What holds for every detector."""

    min_gap: float = Field(5.0, ge=0, description="seconds that must lie between the frames of a loop")
    max_candidates: int = Field(5, gt=0, description="candidates a query may hand to the verification")
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
    min_node_share: float = Field(0.2, ge=0, le=1, description="share of similar nodes that makes a candidate")
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


class VerificationConfig(Section):
    """Gates between a candidate and a constraint."""

    features: FeatureConfig = FeatureConfig(count=2000, per_cell=12)
    min_inliers: int = Field(20, gt=5, description="feature matches that must agree on the pose")
    min_first_inliers: int = Field(
        8, gt=5, description="matches that must agree on it before they are looked for there"
    )
    match_ratio: float = Field(0.9, gt=0, le=1, description="a match's distance over that of the second best, at most")
    max_reprojection: float = Field(3.0, gt=0, description="pixels within which a match agrees with a pose")
    min_points: int = Field(100, gt=5, description="points that both clouds must have")
    icp: Literal["point_to_plane", "generalized", "colored"] = Field("point_to_plane", description="kind of ICP")
    search_distances: tuple[float, ...] = Field((0.3, 0.1), description="metres, the same where few features agree yet")
    icp_distances: tuple[float, ...] = Field((0.1, 0.05), description="metres, correspondence limit of each ICP pass")
    max_shift: float = Field(20.0, gt=0, description="pixels, median, by which ICP may move the agreeing matches")
    fit_distance: float = Field(0.05, gt=0, description="metres within which a point meets the other surface")
    min_fitness: float = Field(0.25, ge=0, le=1, description="share of the query's points on the match's surface")
    max_rmse: float = Field(0.035, gt=0, description="metres, over those points")
    overlap_distance: float = Field(0.1, gt=0, description="metres within which a point counts as seen by the other")
    min_overlap: float = Field(0.15, ge=0, le=1, description="share of either view that the other must see")
    max_free_space: float = Field(0.1, ge=0, le=1, description="share of points that may stand in seen-through space")
    max_sigma: float = Field(0.25, gt=0, description="metres, standard deviation of the position at the most")
    icp_inflation: float = Field(50.0, gt=0, description="factor on ICP's formal variance: points err together")
    pnp_inflation: float = Field(30.0, gt=0, description="factor on PnP's formal variance")
    sigma_rotation: float = Field(0.012, ge=0, description="radians, error that no formal variance knows of")
    sigma_translation: float = Field(0.012, ge=0, description="metres, the same; both at full overlap")


class BundleConfig(Section):
    """Bundle adjustment of keyframes and landmarks after the closures."""

    rounds: int = Field(3, gt=0, description="adjustments, each without the outliers of the one before")
    iterations: int = Field(5, gt=0, description="Levenberg-Marquardt steps of a round at the most")
    max_observations: int = Field(250, gt=0, description="observations a keyframe needs; more are mostly left out")
    pixel_sigma: float = Field(1.0, gt=0, description="pixels; error of a keypoint")
    sighting_share: float = Field(
        0.0625, gt=0, le=1, description="information of a sighting against an independent one; neighbours repeat errors"
    )
    disparity_weight: float = Field(0.5, gt=0, description="weight of depth, as a virtual disparity, against a pixel")
    baseline: float = Field(0.08, gt=0, description="metres between the virtual stereo pair's cameras")
    outlier: float = Field(2.8, gt=0, description="whitened reprojection error at which an observation is dropped")
    min_views: int = Field(2, gt=1, description="keyframes that must see a landmark")


class BackendConfig(Section):
    """The pose graph's optimisation."""

    robust: str = Field("gnc", description="how false loops are held off: gnc, pcm, dcs, cauchy, huber or none")
    max_residual: float = Field(
        4.7, gt=0, description="Mahalanobis distance at which a loop is taken for false; 4.7 = 99.9 % of true ones"
    )
    max_iterations: int = Field(100, gt=0, description="Levenberg-Marquardt steps at the most")
    drift_slack: float = Field(
        1.5, ge=0, description="times max_residual that a loop may lie from odometry alone; 0 = no such test"
    )
    max_odometry_scale: float = Field(
        10.0, ge=1, description="how far odometry's deviations may be widened where most loops contradict them"
    )
    contribution_limit: int = Field(
        100_000, ge=0, description="keyframes times accepted loops up to which each loop is left out once; 0 = never"
    )
    max_loop_scale: float = Field(
        3.0, ge=1, description="how far the loops' deviations may be widened where neighbouring ones disagree"
    )
    bundle: BundleConfig = BundleConfig()


class Config(Section):
    """Everything that decides a run besides the images."""

    seed: int = Field(0, ge=0, description="seed of everything that draws random numbers")
    odometry: str = Field("feature_map", description="registered odometry")
    detector: str = Field("fused", description="registered loop detector")
    dataset: DatasetConfig = DatasetConfig()
    features: FeatureConfig = FeatureConfig()
    keyframes: KeyframeConfig = KeyframeConfig()
    feature: FeatureOdometryConfig = FeatureOdometryConfig()
    feature_map: FeatureMapConfig = FeatureMapConfig()
    dense: DenseConfig = DenseConfig()
    kiss: KissConfig = KissConfig()
    segmentation: SegmentationConfig = SegmentationConfig()
    training: TrainingConfig = TrainingConfig()
    loops: LoopConfig = LoopConfig()
    semantic: SemanticConfig = SemanticConfig()
    semantic_paper: PaperSemanticConfig = PaperSemanticConfig()
    fused: FusedConfig = FusedConfig()
    dbow: DbowConfig = DbowConfig()
    conv3: Conv3Config = Conv3Config()
    verification: VerificationConfig = VerificationConfig()
    backend: BackendConfig = BackendConfig()
    plugins: dict[str, dict[str, Any]] = Field({}, description="settings of outside plug-ins, by plug-in name")

    def with_changes(self, **changes: Any) -> Self:
        """A copy with top-level fields or whole sections replaced, checked again.

        Raises:
            ConfigError: a key or value is not known.
        """
        return _validated(type(self), _merged(self.model_dump(), changes))

    def dump(self) -> str:
        """The effective settings as YAML, readable by ``load_config``."""
        return yaml.safe_dump(self.model_dump(mode="json"), sort_keys=False)


ConfigT = TypeVar("ConfigT", bound=Config)


def load_config(path: Path | None = None, overrides: Mapping[str, Any] | None = None) -> Config:
    """Read a YAML file (or the defaults) and lay nested ``overrides`` over it.

    Raises:
        ConfigError: the file cannot be read, or a key or value is not known.
    """
    values: Any = {}
    if path is not None:
        try:
            values = yaml.safe_load(path.read_text(encoding="utf-8")) or {}
        except (OSError, UnicodeDecodeError) as error:
            raise ConfigError(f"The settings file {path} cannot be read: {error}.") from error
        except yaml.YAMLError as error:
            raise ConfigError(f"The settings file {path} is not YAML: {' '.join(str(error).split())}.") from error
        if not isinstance(values, dict):
            raise ConfigError(f"The settings file {path} must hold 'key: value' pairs.")
    return _validated(Config, _merged(values, overrides or {}))


def parse_overrides(settings: list[str]) -> dict[str, Any]:
    """Turn ``section.key=value`` texts (values in YAML) into a nested dict.

    Raises:
        ConfigError: a text has no '=' or a value is not YAML.
    """
    nested: dict[str, Any] = {}
    for setting in settings:
        dotted, equals, text = setting.partition("=")
        if not equals:
            raise ConfigError(f"A setting is written section.key=value, not '{setting}'.")
        try:
            value = yaml.safe_load(text)
        except yaml.YAMLError as error:
            raise ConfigError(f"The value in '{setting}' is not readable.") from error
        *sections, key = dotted.strip().split(".")
        node = nested
        for section in sections:
            node = node.setdefault(section, {})
        node[key] = value
    return nested


def _merged(base: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    merged = dict(base)
    for key, change in changes.items():
        value = change.model_dump() if isinstance(change, Section) else change
        inside = merged.get(key)
        merged[key] = _merged(inside, value) if isinstance(inside, dict) and isinstance(value, Mapping) else value
    return merged


def _validated(model: type[ConfigT], values: Mapping[str, Any]) -> ConfigT:
    try:
        return model.model_validate(values)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"]) or "settings"
        if first["type"] == "extra_forbidden":
            raise ConfigError(f"There is no setting '{where}' (see 'semslam config' for all of them).") from error
        raise ConfigError(f"Setting '{where}': {first['msg'].lower()}, not {first['input']!r}.") from error
