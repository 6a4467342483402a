"""Settings of keyframes."""

from semslam.config.section import Section, setting


class KeyframeConfig(Section):
    """When a frame becomes a keyframe (paper, section 3.1.1: at a time interval), and which cloud it keeps."""

    interval: float = setting(0.33, "time between keyframes", unit="s", gt=0)
    max_translation: float = setting(0.3, "motion after which a keyframe is inserted earlier", unit="m", gt=0)
    max_rotation: float = setting(0.35, "rotation after which a keyframe is inserted earlier", unit="rad", gt=0)
    cloud_voxel: float = setting(0.04, "voxel size of the stored cloud", unit="m", gt=0)
    max_depth: float = setting(6.0, "depth up to which points are stored", unit="m", gt=0)
