"""Command lines that cannot be followed: one sentence each on standard error; nothing else is printed or written."""

from pathlib import Path

import pytest

from tests.small_valves import THESIS_SET, settings

TRELOAR = str(Path(__file__).parents[1] / "fit" / "treloar.csv")
COARSE = settings({"mesh.around": 8, "mesh.along": 16, "damping.alpha": 0})
PLAIN = settings({"onset.normal_form": False, "onset.coarse_mesh": 0})
LOSS = ("--set", "damping.model=loss factor")
PRESSURES = ("nan", "inf", "-3", "-36 kPa", "0", "1e9", "5 mm", "2000 m", "much", "", "1:2", "5:1:3", "1:2:0", "a:b:c")
#: What was given, and what the sentence must match.
MISUSE = [
    *(((*words.split(" "),), "") for words in ("cas", "case --nonsense", "case a b", "case --set", "doctor x")),
    (("case", "--explain", "drive.presure"), "drive.pressure"),
    *((("steady", "--pressure", pressure, "-o", "r.h5"), "") for pressure in PRESSURES),
    *((("steady", *THESIS_SET, "-p", given), "Pa or m?") for given in ("2", "2e3", "2:50:12", "2 kPa:50:12", "-3")),
    (("steady", "--set", "mesh.around=nine", "-p", "6 kPa"), ""),
    (("steady", "--set", "steady.pressures=[-1]", "-p", "6 kPa"), ""),
    (("steady", "--set", "shell.metric=true", "-p", "6 kPa"), ""),
    (("steady", "--set", "drive.pressure=-1", "-p", "6 kPa"), ""),
    (("steady", "-o", "s.csv", "--units", "furlong"), "no unit to choose"),
    (("steady", "-o", "s.csv", "--units", "m, ft"), "second unit"),
    (("steady", "-o", "no/such/folder/s.csv"), "cannot be written"),
    (("steady", "--scale", "2", "-o", "s.h5"), "goes with a sheet"),
    (("steady", "--scale", "4 kPa", "-o", "s.csv"), "not a length"),
    (("modes", "-o", "s.csv"), "names a sheet"),
    (("modes", "-o", "m.json"), "would be an HDF5 file"),
    *((("modes", *COARSE, "-p", pressure), "") for pressure in ("0", "nan", "-3")),
    (("modes", *COARSE, "--density", "0"), ""),
    (("modes", *COARSE, "--density", "2 m"), ""),
    (("modes", *COARSE, "--count", "0"), ""),
    (("modes", *COARSE, "--animate", "1"), ""),
    (("modes", *COARSE, "--set", "modes.cuont=3"), ""),
    (("modes", "--law=volume"), "quasi-steady, storage or both"),
    (("onset", "--law=volume"), "quasi-steady, storage or both"),
    (("onset", "--over", "angle=20:140:5", *PLAIN), "not within 0 to 90"),
    (("onset", "--over", "colour", *PLAIN), "onset.over"),
    *((("sweep", *COARSE, "--over", over), "") for over in ("density", "mass=1:2:3", "density=3:1:4", "density=0:1:4")),
    (("sensitivity", *COARSE, "--of", "colour"), "'colour'"),
    (("closure", "-p", "-3 kPa"), ""),
    (("transient", "--set", "transient.numerical_damping=0.7"), ""),
    (("transient", "--animate", "last.mp4"), ""),
    (("resume", "none.h5"), ""),
    (("resume", "none.h5", "--animate", "last.mp4"), ""),
    (("verdict", "none.csv"), ""),
    (("damping", "--at", "5"), "--at is given as '5'.*two different frequencies"),
    (("damping", "--set", "materials.CR.loss_factor=3"), "materials.CR.loss_factor is given as 3"),
    (("damping", *LOSS, "--set", "damping.beta=1 ms"), "damping.beta is 0.001 s"),
    (("damping", *LOSS, "--set", "materials.CR.loss_data=gone.csv"), "does not exist"),
    (("fit", "none.csv"), "none.csv cannot be read"),
    (("fit", TRELOAR, "--stable-to", "-3 %"), "--stable-to is given as '-3 %'"),
    (("fit", TRELOAR, "--stable-to", "30 %"), "--stable-to goes with --constraint stable alone"),
    (("fit", TRELOAR, "--stable-to", "much"), "--stable-to is given as 'much'"),
    (("fit", TRELOAR, "--density", "3 m"), "--density is given as '3 m'"),
    (("fit", TRELOAR, "--name", "a b"), "--name 'a b' must be of letters"),
    (("fit", TRELOAR, "--law", "yeoh", "--terms", "7"), "2 or 3 terms, but 7"),
    (("fit", TRELOAR, "--terms", "3"), "needs the law"),
    (("fit", TRELOAR, "--planar", TRELOAR), "holds a planar test already"),
]


@pytest.mark.parametrize(
    "arguments, words", MISUSE, ids=[" ".join(a for a in given if "set=" not in a)[:60] for given, _ in MISUSE]
)
def test_one_sentence_for_a_wrong_command_line(misused, monkeypatch, tmp_path, arguments, words):
    monkeypatch.chdir(tmp_path)
    misused(words, *arguments)
    assert not list(tmp_path.iterdir())
