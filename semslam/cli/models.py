"""semslam segment, train-segmenter, eval-segmenter."""

from semslam.cli.command import Command

COMMANDS: tuple[Command, ...] = ()
