"""Search for inputs that break a target, with coverage as the guide (atheris).

Run: python fuzz/run.py TARGET SECONDS FOLDER        (make fuzz runs all of them)

Ends with 0 where nothing was found. A finding is written to FOLDER/crash-...: mend it, and keep the file in
fuzz/findings/TARGET, from where `make test` runs it.
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import atheris

with atheris.instrument_imports(include=["dialects", "families", "drives", "simulator", "macros", "shell"]):
    from fuzz.targets import TARGETS, seeds

LONGEST = 2048
SLOWEST = 10
MEMORY = 1500


def main() -> None:
    """Run one target."""
    name, seconds, folder = sys.argv[1], int(sys.argv[2]), Path(sys.argv[3])
    corpus = folder / name
    corpus.mkdir(parents=True, exist_ok=True)
    for number, seed in enumerate(seeds(name)):
        (corpus / f"seed-{number}").write_bytes(seed)
    options = [f"-max_total_time={seconds}", f"-max_len={LONGEST}", f"-timeout={SLOWEST}", f"-rss_limit_mb={MEMORY}"]
    prefix = f"-artifact_prefix={folder}/{name}-"
    atheris.Setup([sys.argv[0], *options, prefix, "-print_final_stats=1", str(corpus)], TARGETS[name])
    atheris.Fuzz()


if __name__ == "__main__":
    main()
