"""``python -m tests.golden``."""

from __future__ import annotations

import json
import sys
import time

from .compare import DOCUMENTS, differences, document, path_of, steady
from .runs import RUNS


def main(words: list[str]) -> int:
    """Compare or write the runs whose names hold one of the words; return the number of those that differ."""
    write, words = "--write" in words, [word for word in words if word != "--write"]
    wrong, runs = 0, {name: run for name, run in RUNS.items() if not words or any(word in name for word in words)}
    if not runs:
        sys.exit(f"No run has {' or '.join(words)} in its name.")
    DOCUMENTS.mkdir(exist_ok=True)
    for name, arguments in runs.items():
        start = time.time()
        found = document(arguments)
        if write:
            path_of(name).write_text(json.dumps(found, indent=1, sort_keys=True) + "\n")
            left = []
        else:
            left = list(differences(found, steady(json.loads(path_of(name).read_text()))))
        wrong += bool(left)
        print(f"{name:32s} {time.time() - start:6.1f} s  {found.get('message', '')} {len(left) or ''}", flush=True)
        for line in left[:8]:
            print("    ", line)
    print(f"{wrong} runs differ." if not write else "Written.")
    return wrong


if __name__ == "__main__":
    sys.exit(bool(main(sys.argv[1:])))
