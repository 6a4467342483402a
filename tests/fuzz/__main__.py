"""Fuzz a target with atheris: ``python -m tests.fuzz TARGET [SECONDS]`` (the extra ``fuzz``).

What raises something foreign is written to the corpus of the repository, where a test reads it from then on.
"""

import hashlib
import sys
import tempfile
from pathlib import Path

import atheris

with atheris.instrument_imports(include=["semslam", "tests.fuzz"]):
    from tests.fuzz.corpus import FOLDER, found, seeds
    from tests.fuzz.targets import TARGETS


def main() -> None:
    name, limit = sys.argv[1], sys.argv[2] if len(sys.argv) > 2 else "60"
    work = Path(tempfile.mkdtemp())
    corpus, folder = work / "corpus", work / "folder"
    for made in (corpus, folder):
        made.mkdir()
    for number, data in enumerate((*seeds(name), *found(name))):
        (corpus / str(number)).write_bytes(data)

    def once(data: bytes) -> None:
        try:
            TARGETS[name](folder, data)
        except Exception:
            kept = FOLDER / name / hashlib.sha256(data).hexdigest()[:12]
            kept.parent.mkdir(parents=True, exist_ok=True)
            kept.write_bytes(data)
            raise

    atheris.Setup([sys.argv[0], str(corpus), f"-max_total_time={limit}", "-max_len=4096"], once)
    atheris.Fuzz()


main()
