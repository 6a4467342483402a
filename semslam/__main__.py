"""``python -m semslam`` is the command ``semslam``."""

from semslam.cli import main

if __name__ == "__main__":
    main()
