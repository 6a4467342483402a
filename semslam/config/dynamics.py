"""Settings of what moves."""

from semslam.config.section import Section, setting


class DynamicsConfig(Section):
    """What moves, such as people, and is left out of tracking, keyframes, loops and maps."""

    free_space: bool = setting(True, "leave out surfaces that stand where a frame shortly before looked through")
