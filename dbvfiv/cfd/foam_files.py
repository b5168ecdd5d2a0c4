"""Files of an OpenFOAM case: steady, incompressible, k-omega SST (Menter 1994)."""

from __future__ import annotations

import math
from dataclasses import dataclass

#: Turbulence of the stream that comes in: fluctuations over the mean velocity, eddies over the diameter.
INTENSITY, EDDIES = 0.03, 0.07
_C_MU = 0.09


@dataclass(frozen=True)
class Stream:
    """The flow that is asked for.

    Attributes
    ----------
    volume_flow : float, m3/s
        Of the whole valve.
    bore : float, m
        Diameter of the pipe that it comes from.
    density : float, kg/m3
    viscosity : float, m2/s
    free : bool
        Whether the jet goes into a room instead of a pipe.
    iterations : int
        At most.
    """

    volume_flow: float
    bore: float
    density: float
    viscosity: float
    free: bool = False
    iterations: int = 400

    @property
    def velocity(self) -> float:
        """Mean velocity of the stream that comes in, m/s."""
        return self.volume_flow / (0.25 * math.pi * self.bore**2)

    @property
    def turbulence(self) -> tuple[float, float]:
        """k, m2/s2, and omega, 1/s, of it."""
        k = 1.5 * (INTENSITY * self.velocity) ** 2
        return k, math.sqrt(k) / (_C_MU**0.25 * EDDIES * self.bore)


def case_files(stream: Stream) -> dict[str, str]:
    """All files but the mesh, by their places in the case."""
    files = {f"0/{name}": text for name, text in _fields(stream).items()}
    files["constant/transportProperties"] = _foam(
        "transportProperties", f"transportModel Newtonian;\nnu {stream.viscosity:.8g};\n"
    )
    files["constant/turbulenceProperties"] = _foam(
        "turbulenceProperties", "simulationType RAS;\nRAS { RASModel kOmegaSST; turbulence on; printCoeffs off; }\n"
    )
    files["system/controlDict"] = _foam("controlDict", _CONTROL % stream.iterations)
    files["system/fvSchemes"] = _foam("fvSchemes", _SCHEMES)
    files["system/fvSolution"] = _foam("fvSolution", _SOLUTION)
    files["Allrun"] = _RUN
    return files


def _fields(stream: Stream) -> dict[str, str]:
    """Boundary and initial values of p, U, k, omega and nut."""
    k, omega = stream.turbulence
    wall = "type noSlip;" if not stream.free else "type slip;"
    start = f"uniform (0 0 {-stream.velocity:.8g})"
    quarter = stream.volume_flow / 4.0
    return {
        "p": _field(
            "p", "volScalarField", "0 2 -2 0 0 0 0", "uniform 0", _OPEN, "type fixedValue; value uniform 0;", _OPEN
        ),
        "U": _field(
            "U",
            "volVectorField",
            "0 1 -1 0 0 0 0",
            start,
            f"type flowRateInletVelocity; volumetricFlowRate {quarter:.10g}; value {start};",
            "type inletOutlet; inletValue uniform (0 0 0); value uniform (0 0 0);",
            "type noSlip;",
            wall,
        ),
        "k": _field(
            "k", "volScalarField", "0 2 -2 0 0 0 0", f"uniform {k:.8g}", *_turbulent(k, "kqRWallFunction", stream)
        ),
        "omega": _field(
            "omega",
            "volScalarField",
            "0 0 -1 0 0 0 0",
            f"uniform {omega:.8g}",
            *_turbulent(omega, "omegaWallFunction", stream),
        ),
        "nut": _field(
            "nut",
            "volScalarField",
            "0 2 -1 0 0 0 0",
            "uniform 0",
            "type calculated; value uniform 0;",
            "type calculated; value uniform 0;",
            "type nutUSpaldingWallFunction; value uniform 0;",
            "type calculated; value uniform 0;" if stream.free else None,
        ),
    }


_OPEN = "type zeroGradient;"


def _turbulent(value: float, wall: str, stream: Stream) -> tuple[str, str, str, str | None]:
    """Conditions of a quantity of the turbulence: inlet, outlet, walls, and the far side of a room."""
    fixed = f"value uniform {value:.8g};"
    return (
        f"type fixedValue; {fixed}",
        f"type inletOutlet; inletValue uniform {value:.8g}; {fixed}",
        f"type {wall}; {fixed}",
        _OPEN if stream.free else None,
    )


def _field(name, kind, dimensions, start, inlet, outlet, wall, far=None) -> str:
    lines = [
        f"dimensions [{dimensions}];",
        f"internalField {start};",
        "boundaryField",
        "{",
        f"    inlet {{ {inlet} }}",
        f"    outlet {{ {outlet} }}",
        "    centre { type symmetryPlane; }",
        "    side { type symmetryPlane; }",
        f'    "inner|outer|lip|flange|upstream" {{ {wall} }}',
        f"    downstream {{ {far or wall} }}",
        "}",
    ]
    return _foam(name, "\n".join(lines) + "\n", kind)


def _foam(name: str, body: str, kind: str = "dictionary") -> str:
    return f"FoamFile {{ version 2.0; format ascii; class {kind}; object {name}; }}\n\n{body}"


_CONTROL = """application simpleFoam;
startFrom latestTime;
startTime 0;
stopAt endTime;
endTime %d;
deltaT 1;
writeControl timeStep;
writeInterval 100;
purgeWrite 1;
writeFormat ascii;
writePrecision 8;
timePrecision 8;
runTimeModifiable true;
functions
{
    inletPressure
    {
        type surfaceFieldValue;
        libs (fieldFunctionObjects);
        writeFields false;
        log false;
        regionType patch;
        name inlet;
        operation areaAverage;
        fields (p);
    }
}
"""

_SCHEMES = """ddtSchemes { default steadyState; }
gradSchemes { default cellLimited Gauss linear 1; grad(p) Gauss linear; }
divSchemes
{
    default none;
    div(phi,U) bounded Gauss linearUpwind limited;
    div(phi,k) bounded Gauss limitedLinear 1;
    div(phi,omega) bounded Gauss limitedLinear 1;
    div((nuEff*dev2(T(grad(U))))) Gauss linear;
}
laplacianSchemes { default Gauss linear limited corrected 0.33; }
interpolationSchemes { default linear; }
snGradSchemes { default limited corrected 0.33; }
wallDist { method meshWave; }
"""

_SOLUTION = """solvers
{
    p
    {
        solver PCG;
        preconditioner DIC;
        tolerance 1e-9;
        relTol 0.05;
        maxIter 400;
    }
    "(U|k|omega)"
    {
        solver PBiCGStab;
        preconditioner DILU;
        tolerance 1e-10;
        relTol 0.1;
    }
}
SIMPLE
{
    nNonOrthogonalCorrectors 0;
    consistent yes;
    residualControl { p 2e-5; U 1e-5; "(k|omega)" 1e-5; }
}
relaxationFactors { equations { U 0.85; k 0.7; omega 0.7; } }
"""

_RUN = """#!/bin/sh
# Checks the mesh and runs to a steady state.
cd "${0%/*}" || exit 1
[ -d "$WM_PROJECT_DIR" ] || [ ! -d /usr/share/openfoam ] || export WM_PROJECT_DIR=/usr/share/openfoam # Debian's
checkMesh > log.checkMesh 2>&1
exec simpleFoam > log.simpleFoam 2>&1
"""
