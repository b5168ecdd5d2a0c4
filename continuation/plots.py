"""Figures of branches and curves."""

from __future__ import annotations

import numpy as np

_MARKERS = {
    "fold": "s",
    "branch point": "D",
    "hopf": "o",
    "bogdanov-takens": "*",
    "generalised hopf": "^",
    "cusp": "v",
    "zero-hopf": "P",
}


def plot_branch(branch, observable=None, ax=None):
    """Branch diagram, stable parts solid, unstable ones dashed; curves in their two parameters.

    Parameters
    ----------
    branch : Branch
    observable : callable or int, optional
        ``observable(u)``, or the index of an unknown; the largest absolute entry by default.
        Curves in two parameters need none.
    ax : matplotlib axes, optional

    Returns
    -------
    matplotlib.axes.Axes
    """
    if ax is None:
        import matplotlib.pyplot as plt

        ax = plt.subplots()[1]
    two = len(branch.names) == 2
    if observable is None:

        def observable(u):
            return np.abs(u).max()
    elif isinstance(observable, (int, np.integer)):
        index = int(observable)

        def observable(u):
            return u[index]

    def height(u, mu):
        return mu[branch.names[1]] if two else observable(u)

    x = branch.values()
    y = np.array([height(u, branch.mu(i)) for i, u in enumerate(branch.states)])
    unstable = branch.unstable
    if np.all(unstable < 0):
        ax.plot(x, y, "k-")
    else:
        ax.plot(x, y, "k:", linewidth=0.5)
        for keep, style in ((unstable == 0, "k-"), (unstable > 0, "k--")):
            # A segment belongs to a style when both of its ends do.
            ax.plot(x, np.where(keep, y, np.nan), style)
    for special in branch.special:
        if not np.isfinite(special.u).all():
            continue
        ax.plot(
            special.mu[branch.names[0]],
            height(special.u, special.mu),
            _MARKERS.get(special.kind, "x"),
            label=special.kind,
            fillstyle="full" if special.located else "none",
        )
    handles, labels = ax.get_legend_handles_labels()
    unique = dict(zip(labels, handles))
    if unique:
        ax.legend(unique.values(), unique.keys())
    ax.set_xlabel(branch.names[0])
    ax.set_ylabel(branch.names[1] if two else "state")
    return ax
