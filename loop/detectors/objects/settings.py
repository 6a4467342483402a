"""Settings of the detector "objects"."""

from semslam.config import Section, setting


class ObjectsConfig(Section):
    """What a submap is, what counts as an object or a wall, and when two submaps are the same place."""

    reach: float = setting(4.0, "way that the camera went within a submap", unit="m", gt=0)
    max_age: float = setting(9.0, "time that a submap spans", unit="s", gt=0)
    max_keyframes: int = setting(24, "maximum number of keyframes of a submap", gt=0)
    min_keyframes: int = setting(3, "number of keyframes below which a submap makes no candidate", gt=0)
    max_depth: float = setting(5.0, "depth up to which points count", unit="m", gt=0)
    voxel: float = setting(0.1, "side of the voxels that votes are counted in", unit="m", gt=0)
    min_voxels: int = setting(6, "number of voxels that make an object", gt=0)
    max_objects: int = setting(30, "maximum number of objects of a submap, the largest kept", gt=2, le=60)
    max_walls: int = setting(10, "maximum number of walls of a submap, the largest kept", gt=0, le=30)
    min_wall: float = setting(0.6, "area of vertical plane that makes a wall", unit="m^2", gt=0)
    shortlist: int = setting(15, "number of submaps that are matched object by object", gt=0)
    spacing: float = setting(1.0, "minimum time between two of these", unit="s", ge=0)
    radius: float = setting(3.5, "maximum horizontal distance of the two cameras of a loop", unit="m", gt=0)
    tolerance: float = setting(0.3, "standard deviation of matched objects' distance", unit="m", gt=0)
    wall_tolerance: float = setting(0.12, "standard deviation of matched walls' distance", unit="m", gt=0)
    use_labels: bool = setting(
        True, "cut and compare objects by their classes; without, objects are what lies on no wall, floor or ceiling"
    )
    use_look: bool = setting(True, "compare how objects look")
    use_structure: bool = setting(True, "match walls too")
    use_up: bool = setting(True, "find up by the floor and other surfaces; without, cameras are taken to be level")
    min_objects: int = setting(
        4, "number of matched objects that makes a candidate; walls alone meet in any corner", ge=0
    )
    min_score: float = setting(0.2, "share of matched objects and walls that makes a candidate", ge=0, le=1)
