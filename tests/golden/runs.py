"""Runs by name: the arguments of ``dbvfiv``."""

from __future__ import annotations

from dbvfiv.studies.case import THESIS

#: A mesh on which a run takes a few seconds.
MESH = {"mesh.around": 6, "mesh.along": 8}
#: The thesis's set-up at an opening that flutters.
FORMER = THESIS | MESH | {"damping.alpha": 0.0, "drive.pressure": "6 kPa", "fluid.density": 60.0}
#: The defaults, with strain levels that need not be sought.
PRESENT = MESH | {"materials.strain_level": 0.2, "drive.pressure": "6 kPa"}

LINE = {"upstream.length": "20 m", "upstream.diameter": "0.3 m", "upstream.loss": 0.5}
ROUGH = LINE | {"upstream.roughness": "0.1 mm"}
WAVES = LINE | {"upstream.wave_speed": "300 m/s", "upstream.elements": 4}
TAIL = {"downstream.pipe_diameter": "0.4 m", "downstream.length": "2 m", "downstream.loss": 1.0}
WATER = {"outside.fluid": "same"}
GAS = {"fluid.density": 1.2, "fluid.sound_speed": "340 m/s", "drive.pressure": "2 kPa"}
FRICTION = {"fluid.viscosity": "1 mPa*s"}
HALF = {"mesh.part": "half", "mesh.around": 5}
#: A pump that feeds an elastic line at its operating point at 6 kPa, water outside and friction in the valve.
PUMPED = WAVES | WATER | FRICTION | {"upstream.pump": "[[0, 0.9], [0.0139487, 0.611829], [0.03, 0.2]]"}
#: Keys of an installation by its name.
INSTALLATIONS = {
    "line": LINE,
    "rough": ROUGH,
    "waves": WAVES,
    "tail": TAIL,
    "water": WATER,
    "gas": GAS,
    "friction": FRICTION,
    "half": HALF,
    "pumped": PUMPED,
    "gas-waves": GAS | WAVES | {"upstream.length": "3 m"},
    "half-water": HALF | WATER,
}
#: Onsets without what takes minutes: their kind, and what a finer mesh moves.
ONSET = {"onset.coarse_mesh": 0, "onset.normal_form": "false"}
SHORT = {"transient.step": 1e-3, "transient.duration": 0.04}
KICK = SHORT | {"transient.start": "kick", "transient.kick_opening": 1e-6}


def arguments(study: str, keys, *options: str) -> list[str]:
    """Command line of a study with keys of the case set."""
    return [study, *(f"--set={key}={value}" for key, value in keys.items()), *options, "--json"]


def _runs() -> dict[str, list[str]]:
    runs = {}
    laws = ("quasi-steady", "storage")
    for name, keys in (("thesis", FORMER), ("default", PRESENT)):
        runs[f"steady-{name}"] = arguments("steady", keys, "-p", "2 kPa", "-p", "18 kPa")
        for law in laws:
            both = keys | {"fluid.continuity": law}
            runs[f"modes-{name}-{law}"] = arguments("modes", both, "--count=5")
            runs[f"sweep-{name}-{law}"] = arguments("sweep", both, "--over=density=20:200:5:log", "--count=3")
            coarse = both | ONSET
            runs[f"onset-{name}-{law}"] = arguments("onset", coarse, "--over=density=0.5:500:7:log")
            plain = both | {"map.checks": 1}
            runs[f"map-{name}-{law}"] = arguments("map", plain, "--x=pressure=2e3:20e3:4", "--y=density=2:200:4:log")
        of = ("--of=pressure", "--of=density", "--of=thickness", "--of=layer 3 angle")
        runs[f"sensitivity-{name}"] = arguments("sensitivity", keys, *of)
        runs[f"transient-{name}"] = arguments("transient", keys | SHORT)
        runs[f"closure-{name}"] = arguments("closure", keys, "-p", "2 kPa", "-p", "8 kPa")
        for letters in ("SA", "AS", "AA"):
            runs[f"modes-{name}-{letters}"] = arguments("modes", keys, f"--symmetry={letters}", "--count=3")
    for damping in ("alpha", "beta"):
        run = arguments("onset", FORMER | ONSET, f"--over={damping}")
        runs[f"onset-thesis-{damping}"] = run
    runs["onset-default-loss_factor"] = arguments("onset", PRESENT | ONSET, "--over=loss_factor")
    runs["onset-thesis-pressure"] = arguments("onset", FORMER | ONSET, "--over=pressure=2e3:12e3:6")
    kind = FORMER | {"onset.coarse_mesh": 0}
    runs["onset-kind"] = arguments("onset", kind, "--over=density=60:600:3:log")
    runs["modes-vacuo"] = arguments("modes", PRESENT, "--in-vacuo", "--count=5")
    runs["modes-both-laws"] = arguments("modes", FORMER, "--law=both", "--count=3")
    runs["sweep-thesis-pressure"] = arguments("sweep", FORMER, "--over=pressure=2e3:12e3:5", "--count=2")
    runs["cycle-thesis"] = arguments("cycle", FORMER, "--over=density=60:600:4")
    modes = "[{frequency=28.3, frequency_interval=0.3, damping_ratio=0.14, damping_ratio_interval=0.01}]"
    known = {"identify.records": modes, "identify.over": "pressure=3e3,6e3", "identify.samples": 8, "identify.round": 6}
    learned = {"uncertainty.inputs.loss_factor": "lognormal(1.3)", "uncertainty.inputs.thickness": "normal(3 %)"}
    runs["identify"] = arguments("identify", PRESENT | known | learned | {"identify.rounds": 1})
    runs["levels"] = arguments("levels", MESH, "-p", "6 kPa", "-p", "18 kPa")
    for name, keys in INSTALLATIONS.items():
        runs[f"steady-{name}"] = arguments("steady", PRESENT | keys, "-p", "3 kPa")
        runs[f"modes-{name}"] = arguments("modes", PRESENT | keys, "--count=4")
        # the first mode of both lips together moves them to one side, and a kick is measured by the lip's middle
        mode = {"transient.kick_mode": 2} if name == "half" else {}
        runs[f"kick-{name}"] = arguments("transient", PRESENT | KICK | keys | mode)
    return runs


RUNS = _runs()
