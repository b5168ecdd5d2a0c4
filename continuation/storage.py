"""Branches in HDF5.

One file: attributes and ``header`` (JSON) with names, parameters and the reason of the
end; ``z``, ``tangent`` of shape (points, unknowns); one dataset per number; ragged
eigenvalues padded with nan; one group per special point.
"""

from __future__ import annotations

import json
import os
from pathlib import Path

import h5py
import numpy as np

FORMAT = 1


def save(branch, path: Path) -> None:
    """Write a `Branch`, through a temporary file that then takes the name."""
    partial = path.with_name(path.name + ".partial")
    with h5py.File(partial, "w") as file:
        _write(file, branch)
    os.replace(partial, path)


def _write(file, branch) -> None:
    points = branch.points
    file.attrs["format"] = FORMAT
    file.attrs["header"] = json.dumps(
        {
            "kind": branch.kind,
            "size": branch.size,
            "names": branch.names,
            "extra_names": branch.extra_names,
            "fixed": branch.fixed,
            "reason": branch.reason,
            "next_step": branch.next_step,
        }
    )
    file["z"] = np.array([p.z for p in points])
    file["tangent"] = np.array([p.tangent for p in points])
    for name in ("step", "iterations", "residual", "unstable"):
        file[name] = np.array([getattr(p, name) for p in points])
    width = max((p.eigenvalues.size for p in points), default=0)
    padded = np.full((len(points), width), np.nan + 0j)
    for row, point in zip(padded, points):
        row[: point.eigenvalues.size] = point.eigenvalues
    file["eigenvalues"] = padded
    names = sorted({name for p in points for name in p.tests})
    tests = file.create_group("tests")
    for name in names:
        tests[name] = np.array([p.tests.get(name, np.nan) for p in points])
    for name, array in branch.restart.items():
        file[f"restart/{name}"] = array
    group = file.create_group("special")
    for number, special in enumerate(branch.special):
        item = group.create_group(f"{number:06d}")
        item.attrs["header"] = json.dumps(
            {
                "kind": special.kind,
                "index": special.index,
                "mu": special.mu,
                "located": special.located,
                "reason": special.reason,
                "values": {k: (v if isinstance(v, str) else float(v)) for k, v in special.values.items()},
            }
        )
        item["u"], item["z"], item["tangent"] = special.u, special.z, special.tangent
        for name, vector in special.vectors.items():
            item[f"vectors/{name}"] = vector


def load(path: Path, make_branch, make_point, make_special):
    """Read a `Branch`, made of the types that are given.

    Raises
    ------
    ValueError
        The file is not one of these, or of an unknown format.
    """
    with h5py.File(path, "r") as file:
        if file.attrs.get("format") != FORMAT:
            raise ValueError(f"{path} is not a branch file of format {FORMAT}.")
        header = json.loads(file.attrs["header"])
        data = {
            name: file[name][()]
            for name in ("z", "tangent", "step", "iterations", "residual", "unstable", "eigenvalues")
        }
        tests = {name: item[()] for name, item in file["tests"].items()}
        points = []
        for i in range(len(data["z"])):
            values = data["eigenvalues"][i]
            points.append(
                make_point(
                    data["z"][i],
                    data["tangent"][i],
                    float(data["step"][i]),
                    int(data["iterations"][i]),
                    float(data["residual"][i]),
                    {name: float(column[i]) for name, column in tests.items() if not np.isnan(column[i])},
                    int(data["unstable"][i]),
                    values[~np.isnan(values.real)],
                )
            )
        special = []
        for item in file["special"].values():
            own = json.loads(item.attrs["header"])
            vectors = {name: v[()] for name, v in item.get("vectors", {}).items()}
            special.append(
                make_special(
                    own["kind"],
                    own["index"],
                    item["u"][()],
                    own["mu"],
                    item["z"][()],
                    item["tangent"][()],
                    own["located"],
                    own["reason"],
                    own["values"],
                    vectors,
                )
            )
        restart = {name: item[()] for name, item in file.get("restart", {}).items()}
    return make_branch(
        header["kind"],
        header["size"],
        tuple(header["names"]),
        tuple(header["extra_names"]),
        header["fixed"],
        points,
        special,
        header["reason"],
        header["next_step"],
        restart,
    )
