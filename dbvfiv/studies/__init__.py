"""Studies: one package for each analysis that the program offers.

A room holds the study's keys of the case file and its command (light to import), how it runs and what comes of it
(`study`), and figures. What several rooms share lies beside them: the `session` that they ask, the `study` and
`result` that they make, `measured` data beside what they compute, `stability`, and the `orbits` of limit cycles.
"""

#: Every study: the name of its room, command, section of the case file and kind of result, in the order of the
#: commands. A new study is a folder and a word here.
KINDS = (
    "steady",
    "levels",
    "modes",
    "sweep",
    "sensitivity",
    "onset",
    "map",
    "uncertainty",
    "design",
    "response",
    "identify",
    "transient",
    "cycle",
    "closure",
)
