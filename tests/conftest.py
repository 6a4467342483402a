"""Fixtures that many tests use."""

from pathlib import Path

import pytest

SHARED = Path(__file__).resolve().parents[2] / "shared"


@pytest.fixture(scope="session")
def shared() -> Path:
    """The folder with real data beside the checkout; tests skip where it is absent."""
    if not (SHARED / "data").is_dir():
        pytest.skip(f"the real data is not here ({SHARED})")
    return SHARED
