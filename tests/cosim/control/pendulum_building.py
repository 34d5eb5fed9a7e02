"""Building the pendulum, an FMU that none of our own tools has made."""

from __future__ import annotations

import subprocess
import zipfile
from pathlib import Path

from attitude_fmu.fmu_src.native.compile import compiler, headers, host_platform

_SOURCE = Path(__file__).with_name("pendulum.c")
_VARIABLES = """
<ScalarVariable name="angle" valueReference="0" causality="output"><Real start="0" unit="rad"/></ScalarVariable>
<ScalarVariable name="rate" valueReference="1" causality="output"><Real start="0"/></ScalarVariable>
<ScalarVariable name="torque" valueReference="2" causality="input"><Real start="0"/></ScalarVariable>
<ScalarVariable name="damping" valueReference="3" causality="parameter" variability="tunable"><Real start="0.4"/>
</ScalarVariable>
<ScalarVariable name="der(angle)" valueReference="4" causality="local"><Real derivative="1"/></ScalarVariable>
<ScalarVariable name="der(rate)" valueReference="5" causality="local"><Real derivative="2"/></ScalarVariable>
<ScalarVariable name="load" valueReference="6" causality="output"><Real/></ScalarVariable>
<ScalarVariable name="count" valueReference="7" causality="output" variability="discrete"><Integer/></ScalarVariable>
<ScalarVariable name="double" valueReference="8" causality="input" variability="discrete"><Boolean start="false"/>
</ScalarVariable>
"""
_STRUCTURE = """<Outputs><Unknown index="1"/><Unknown index="2"/><Unknown index="7"/><Unknown index="8"/></Outputs>
<Derivatives><Unknown index="5"/><Unknown index="6"/></Derivatives>"""
FLAGS = {
    "canGetAndSetFMUstate": "true",
    "canSerializeFMUstate": "true",
    "providesDirectionalDerivative": "true",
    "canHandleVariableCommunicationStepSize": "true",
}


def build_pendulum(folder: Path, **flags: str) -> Path:
    """``Pendulum.fmu`` in the folder, with these flags of its CoSimulation element instead of `FLAGS`."""
    folder.mkdir(exist_ok=True)
    platform = host_platform()
    library = folder / f"Pendulum{platform.suffix}"
    target = ["-target", platform.targets[0], "-shared", "-fPIC", "-O2", "-I", str(headers())]
    subprocess.run([*compiler(), *target, str(_SOURCE), "-lm", "-o", str(library)], check=True)
    attributes = " ".join(f'{name}="{value}"' for name, value in {**FLAGS, **flags}.items())
    description = (
        '<?xml version="1.0" encoding="UTF-8"?><fmiModelDescription fmiVersion="2.0" modelName="Pendulum" guid="{1}">'
        f'<CoSimulation modelIdentifier="Pendulum" {attributes}/>'
        '<DefaultExperiment stepSize="0.01"/>'
        f"<ModelVariables>{_VARIABLES}</ModelVariables><ModelStructure>{_STRUCTURE}</ModelStructure>"
        "</fmiModelDescription>"
    )
    fmu = folder / "Pendulum.fmu"
    with zipfile.ZipFile(fmu, "w") as archive:
        archive.writestr("modelDescription.xml", description)
        archive.write(library, f"binaries/{platform.folder}/{library.name}")
    return fmu
