"""What the package index shows: project.urls, and a README whose links lead somewhere outside the repository too.

Where the repository is, only whoever publishes it knows: the environment variable SEMSLAM_REPOSITORY states its address
(CI sets it). Without it the package has no project.urls, and what would be a link to a file is plain text.
"""

import os
import sys
from pathlib import Path
from typing import Any

from hatchling.metadata.plugin.interface import MetadataHookInterface


class RepositoryMetadataHook(MetadataHookInterface):
    """Fills in ``readme`` and ``urls``."""

    PLUGIN_NAME = "custom"

    def update(self, metadata: dict[str, Any]) -> None:
        """Add both fields to the project's metadata."""
        sys.path.insert(0, self.root)
        from scripts.site.pages import LinkTranslation

        address = os.environ.get("SEMSLAM_REPOSITORY", "").rstrip("/")
        text = (Path(self.root) / "README.md").read_text(encoding="utf-8")
        readme = LinkTranslation({}, address).page(text, "README.md", "README.md")
        metadata["readme"] = {"content-type": "text/markdown", "text": readme}
        if address:
            metadata["urls"] = {
                "Repository": address,
                "Documentation": f"{address}/tree/main/docs",
                "Changelog": f"{address}/blob/main/CHANGELOG.md",
                "Issues": f"{address}/issues",
            }
