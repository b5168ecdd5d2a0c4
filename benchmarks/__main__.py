"""Run the benchmarks: python -m benchmarks [--only NAME ...] [--json FILE]."""

from __future__ import annotations

import argparse
import importlib
import json
import pkgutil
import platform
from pathlib import Path

import benchmarks
import dbvfiv  # noqa: F401  (sets threads and caches before anything is imported)

from .registry import BENCHMARKS


def main() -> None:
    for module in pkgutil.iter_modules(benchmarks.__path__):
        if module.name not in ("__main__", "registry"):
            importlib.import_module(f"benchmarks.{module.name}")
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument(
        "--only",
        nargs="+",
        choices=sorted(BENCHMARKS),
        default=sorted(BENCHMARKS),
        metavar="NAME",
        help="of " + ", ".join(sorted(BENCHMARKS)),
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the rows here")
    chosen = parser.parse_args()
    rows = []
    print(f"{platform.platform()}, one thread; targets are upper limits")
    for name in chosen.only:
        print(f"\n{name}")
        for row in BENCHMARKS[name]():
            verdict = (
                ""
                if row.target is None
                else f"   target {row.target:g} {'met' if row.value <= row.target else 'MISSED'}"
            )
            print(
                f"  {row.what:78s} {row.value:10.4g} {row.unit:5s}{verdict}{'   ' + row.note if row.note else ''}",
                flush=True,
            )
            rows.append({"benchmark": name} | row.to_dict())
    if chosen.json:
        chosen.json.write_text(json.dumps(rows, indent=1) + "\n")


if __name__ == "__main__":
    main()
