"""Makes functional mock-up units (FMI 2.0 and 3.0) of scenes.

`simulate --emit-fmu` runs this file by itself: it reads a description as JSON from standard input, compiles the C in
it and writes the archive to the file that the argument names; the reason why there is none goes to standard output
(exit status 1). So it imports nothing of the package, whose compiled module is not needed here.
"""

import html
import json
import os
import pathlib
import platform
import shutil
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as xml
import zipfile

# Every operation rounds separately, as in the package itself, and every function is the library's.
OPTIONS = ["-std=c11", "-O2", "-ffp-contract=off", "-fno-math-errno", "-fno-tree-slp-vectorize", "-fno-builtin",
           "-fvisibility=hidden"]
LINKING = ["-fPIC", "-shared", "-fno-semantic-interposition", "-fno-plt", "-s"]
# Names of platforms by machine, in FMI 2 and 3.
PLATFORMS = {"x86_64": {2: "linux64", 3: "x86_64-linux"}, "aarch64": {2: "aarch64-linux", 3: "aarch64-linux"}}
BASE_UNITS = ("kg", "m", "s", "A", "K", "rad")
MODES = {"backward": -1, "stuck": 0, "forward": 1, "free": 2}
GENERATOR = "variator_sim"
# One time for all members: the same scene makes the same bytes.
MEMBER_TIME = (1980, 1, 1, 0, 0, 0)


class Variable:
    """A variable of the model description, from the description's entry."""

    CAUSALITIES = {"time": "independent", "state": "output", "output": "output", "mode": "output", "input": "input",
                   "parameter": "parameter"}

    def __init__(self, reference, entry):
        self.reference = reference
        self.kind = entry["kind"]
        self.name = entry["name"]
        self.unit = entry["unit"]
        self.limits = {key: repr(entry[key]) for key in ("min", "max") if key in entry}
        self.start = repr(entry["start"]) if self.kind in ("input", "parameter") else None

    @property
    def causality(self):
        return self.CAUSALITIES[self.kind]

    @property
    def variability(self):
        return {"parameter": "fixed", "mode": "discrete"}.get(self.kind, "continuous")

    @property
    def is_output(self):
        return self.causality == "output"

    def attributes(self, units):
        """Those of the scalar variable, and those of its type."""
        own = {"name": self.name, "valueReference": str(self.reference), "causality": self.causality,
               "variability": self.variability}
        if self.kind == "parameter":
            own["initial"] = "exact"
        typed = {"declaredType": "Mode"} if self.kind == "mode" else dict(self.limits)
        if self.unit in units:
            typed["unit"] = self.unit
        if self.start is not None:
            typed["start"] = self.start
        return own, typed


def _element(parent, tag, /, **attributes):
    return xml.SubElement(parent, tag, attributes)


def _describe_units(root, units):
    definitions = _element(root, "UnitDefinitions")
    for name, (factor, *exponents) in units.items():
        base = {key: str(exponent) for key, exponent in zip(BASE_UNITS, exponents) if exponent}
        if factor != 1:
            base["factor"] = repr(float(factor))
        if len(exponents) > len(BASE_UNITS):  # of degC
            base["offset"] = repr(float(exponents[-1]))
        _element(_element(definitions, "Unit", name=name), "BaseUnit", **base)


def _describe_modes(root, version):
    definitions = _element(root, "TypeDefinitions")
    if version == 2:
        parent = _element(_element(definitions, "SimpleType", name="Mode"), "Enumeration")
    else:
        parent = _element(definitions, "EnumerationType", name="Mode")
    for name, value in MODES.items():
        _element(parent, "Item", name=name, value=str(value))


def _describe_structure(root, version, variables):
    structure = _element(root, "ModelStructure")
    outputs = [it for it in variables if it.is_output]
    inputs = [it for it in variables if it.kind == "input"]
    parameters = [it for it in variables if it.kind == "parameter"]

    def refer(variable):
        return str(variable.reference if version == 3 else variables.index(variable) + 1)

    def add(parent, name, variable, dependencies):
        key = "valueReference" if version == 3 else "index"
        _element(parent, name, **{key: refer(variable),
                                  "dependencies": " ".join(refer(it) for it in dependencies)})

    # Angles and velocities are states: no input moves them at once.
    parent = _element(structure, "Outputs") if version == 2 and outputs else structure
    for it in outputs:
        add(parent, "Output" if version == 3 else "Unknown", it, [] if it.kind == "state" else inputs)
    parent = _element(structure, "InitialUnknowns") if version == 2 and outputs else structure
    for it in outputs:
        add(parent, "InitialUnknown" if version == 3 else "Unknown", it, parameters + ([] if it.kind == "state" else inputs))


def describe_model(model, variables):
    """The text of modelDescription.xml."""
    version = model["version"]
    token = {2: "guid", 3: "instantiationToken"}[version]
    root = xml.Element("fmiModelDescription", {
        "fmiVersion": f"{version}.0", "modelName": model["name"], token: model["token"],
        "description": f"The drivetrain of {model['title']}", "generationTool": GENERATOR,
        "variableNamingConvention": "flat"})
    abilities = {"modelIdentifier": model["name"], "canHandleVariableCommunicationStepSize": "true"}
    if version == 2:
        abilities.update(canGetAndSetFMUstate="true", canSerializeFMUstate="true",
                         canNotUseMemoryManagementFunctions="true", providesDirectionalDerivative="true")
        source = _element(root, "CoSimulation", **abilities)
        _element(_element(source, "SourceFiles"), "File", name=f"{model['name']}.c")
    else:
        abilities.update(canGetAndSetFMUState="true", canSerializeFMUState="true", hasEventMode="true",
                         mightReturnEarlyFromDoStep="true", providesDirectionalDerivatives="true",
                         providesAdjointDerivatives="true")
        _element(root, "CoSimulation", **abilities)
    _describe_units(root, model["units"])
    if any(it.kind == "mode" for it in variables):
        _describe_modes(root, version)
    categories = _element(root, "LogCategories")
    for name in ("logStatusDiscard", "logStatusError"):
        _element(categories, "Category", name=name)
    _element(root, "DefaultExperiment", startTime="0.0", tolerance=repr(model["tolerance"]))
    parent = _element(root, "ModelVariables")
    for variable in variables:
        own, typed = variable.attributes(model["units"])
        name = {2: "Real", 3: "Float64"}[version] if variable.kind != "mode" else "Enumeration"
        if version == 2:
            _element(_element(parent, "ScalarVariable", **own), name, **typed)
        else:
            _element(parent, name, **own, **typed)
    _describe_structure(root, version, variables)
    return _text(root)


def describe_build(model):
    """The text of buildDescription.xml (FMI 3)."""
    root = xml.Element("fmiBuildDescription", fmiVersion="3.0")
    configuration = _element(root, "BuildConfiguration", modelIdentifier=model["name"])
    files = _element(configuration, "SourceFileSet", language="C99", compiler="gcc", compilerOptions=" ".join(OPTIONS))
    _element(files, "SourceFile", name=f"{model['name']}.c")
    _element(configuration, "Library", name="m")
    return _text(root)


def describe_terminals(model, variables):
    """The text of terminalsAndIcons.xml (FMI 3): the shafts."""
    root = xml.Element("fmiTerminalsAndIcons", fmiVersion="3.0")
    terminals = _element(root, "Terminals")
    for shaft in model["shafts"]:
        terminal = _element(terminals, "Terminal", name=shaft, matchingRule="bus")
        for it in variables:
            if it.name.rpartition("/")[0] == shaft and it.is_output:
                _element(terminal, "TerminalMemberVariable", variableKind="signal", variableName=it.name,
                         memberName=it.name.rpartition("/")[2])
    return _text(root)


def write_page(model, variables):
    """The text of documentation/index.html."""
    rows = "".join(f"<tr><td>{html.escape(it.name)}</td><td>{it.causality}</td><td>{html.escape(it.unit)}</td></tr>\n"
                   for it in variables)
    return (f"<!DOCTYPE html>\n<html><head><meta charset=\"utf-8\"><title>{model['name']}</title></head><body>\n"
            f"<h1>{model['name']}</h1>\n<p>The drivetrain of {html.escape(model['title'])}, written by "
            f"<code>simulate --emit-fmu</code> for co-simulation by FMI {model['version']}.0.</p>\n"
            f"<table>\n<tr><th>variable</th><th>causality</th><th>unit</th></tr>\n{rows}</table>\n</body></html>\n")


def _text(root):
    xml.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + xml.tostring(root, encoding="unicode") + "\n"


def _compile(compiler, options, source, target):
    done = subprocess.run([compiler, *OPTIONS, *options, *LINKING, "-o", str(target), str(source), "-lm"],
                          stdin=subprocess.DEVNULL, capture_output=True, text=True)
    if done.returncode != 0:
        raise RuntimeError(f"{compiler} does not compile the scene: {done.stderr.strip()}")


def build(model, folder):
    """Compiles the source in `folder`; the binaries' paths in the archive and here."""
    source = folder / f"{model['name']}.c"
    source.write_text(model["source"])
    version = model["version"]
    here = platform.machine()
    if shutil.which("cc") is None:
        raise RuntimeError("no compiler (cc) was found for the FMU's binary: 'apt install build-essential' installs one")
    compilers = {"aarch64": "aarch64-linux-gnu-gcc", here: "cc"}
    made = {}
    for machine, compiler in compilers.items():
        if shutil.which(compiler) is None:
            continue
        target = folder / f"{machine}.so"
        fuses = model["fuses"] and machine == "x86_64"
        _compile(compiler, ["-mavx2", "-mfma"] if fuses else [], source, target)
        made[f"binaries/{PLATFORMS.get(machine, {version: machine})[version]}/{model['name']}.so"] = target
    return made


def write_archive(model, path):
    """Writes the FMU to `path`, or nothing where that fails."""
    variables = [Variable(reference, entry) for reference, entry in enumerate(model["variables"])]
    if len({it.name for it in variables}) < len(variables):
        raise RuntimeError("two variables of the FMU have one name: an element is called like another's quantity, "
                           "or 'inputs', 'outputs', 'initial', 'scene', 'states' or 'variables'")
    members = {"modelDescription.xml": describe_model(model, variables),
               "documentation/index.html": write_page(model, variables),
               f"sources/{model['name']}.c": model["source"]}
    if model["version"] == 3:
        members["sources/buildDescription.xml"] = describe_build(model)
        members["terminalsAndIcons/terminalsAndIcons.xml"] = describe_terminals(model, variables)
    with tempfile.TemporaryDirectory() as folder:
        members.update((name, file.read_bytes()) for name, file in build(model, pathlib.Path(folder)).items())
    new = pathlib.Path(f"{path}.new-{os.getpid()}")
    try:
        with zipfile.ZipFile(new, "w", zipfile.ZIP_DEFLATED) as archive:
            for name, content in members.items():
                archive.writestr(zipfile.ZipInfo(name, MEMBER_TIME), content, zipfile.ZIP_DEFLATED)
        new.replace(path)
    finally:
        new.unlink(missing_ok=True)


def main():
    del sys.path[0]  # modules of the package are none of Python's
    try:
        write_archive(json.loads(sys.stdin.buffer.read().decode("utf-8", "replace")), sys.argv[1])
    except (OSError, RuntimeError) as error:
        print(error, end="")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
