"""Some sixty runs on coarse meshes over all studies, flow models, classes of motion and installations, and their JSON
documents as they were when they were written: what a change of the program's inside must leave as it is.

    python -m tests.golden              compare every run with its document
    python -m tests.golden NAME ...     those whose names hold one of the words
    python -m tests.golden --write      write documents; say in the commit which numbers moved, how far and why
"""
