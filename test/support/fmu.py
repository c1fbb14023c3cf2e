"""An importer of FMUs for tests: FMI 2.0 and 3.0, co-simulation, by ctypes."""

import ctypes as c
import pathlib
import platform
import xml.etree.ElementTree as xml
import zipfile

OK, WARNING, DISCARD, ERROR = range(4)
MACHINE = platform.machine()
BINARIES = {2: {"x86_64": "linux64"}.get(MACHINE, f"{MACHINE}-linux"), 3: f"{MACHINE}-linux"}


class Archive:
    """An unpacked FMU: its description and its library."""

    def __init__(self, path, folder, library=None):
        self.folder = pathlib.Path(folder)
        with zipfile.ZipFile(path) as archive:
            self.members = archive.namelist()
            archive.extractall(self.folder)
        self.root = xml.parse(self.folder / "modelDescription.xml").getroot()
        self.version = int(self.root.get("fmiVersion")[0])
        self.name = self.root.find("CoSimulation").get("modelIdentifier")
        self.token = self.root.get({2: "guid", 3: "instantiationToken"}[self.version])
        self.variables = {it.get("name"): it for it in self.root.find("ModelVariables")}
        self.reference = {name: int(it.get("valueReference")) for name, it in self.variables.items()}
        self.binary = self.folder / "binaries" / BINARIES[self.version] / f"{self.name}.so"
        self.library = c.CDLL(str(library or self.binary))

    def modes(self):
        return [name for name in self.variables if name.endswith("/mode")]

    def start(self, name):
        it = self.variables[name]
        return float((it if self.version == 3 else it[0]).get("start"))


LOG2 = c.CFUNCTYPE(None, c.c_void_p, c.c_char_p, c.c_int, c.c_char_p, c.c_char_p, c.c_char_p)
LOG3 = c.CFUNCTYPE(None, c.c_void_p, c.c_int, c.c_char_p, c.c_char_p)


class Callbacks2(c.Structure):
    _fields_ = [("logger", LOG2), ("allocate", c.c_void_p), ("free", c.c_void_p), ("finished", c.c_void_p),
                ("environment", c.c_void_p)]


class Instance:
    """One instance; what its logger was told is in `log`."""

    def __init__(self, archive, token=None, events=False, early=False, name="one"):
        self.archive = archive
        self.version = archive.version
        self.log = []
        token = (archive.token if token is None else token).encode()
        if self.version == 2:
            logger = LOG2(lambda _, of, status, category, text, message: self.log.append((status, message.decode())))
            self._kept = Callbacks2(logger, None, None, None, None), logger
            create = archive.library.fmi2Instantiate
            create.restype = c.c_void_p
            self.c = create(name.encode(), 1, token, b"", c.byref(self._kept[0]), 0, 0)
        else:
            self._kept = LOG3(lambda _, status, category, message: self.log.append((status, message.decode())))
            create = archive.library.fmi3InstantiateCoSimulation
            create.restype = c.c_void_p
            self.c = create(name.encode(), token, b"", c.c_bool(False), c.c_bool(False), c.c_bool(events),
                            c.c_bool(early), None, c.c_size_t(0), None, self._kept, None)

    def call(self, name, *arguments):
        """The status of fmi2NAME or fmi3NAME."""
        return getattr(self.archive.library, f"fmi{self.version}{name}")(c.c_void_p(self.c), *arguments)

    def free(self):
        self.call("FreeInstance")
        self.c = None

    def enter(self, start=0.0, stop=None):
        has_stop, end = stop is not None, c.c_double(stop or 0.0)
        if self.version == 2:
            status = self.call("SetupExperiment", 0, c.c_double(0.0), c.c_double(start), int(has_stop), end)
            return status or self.call("EnterInitializationMode")
        return self.call("EnterInitializationMode", c.c_bool(False), c.c_double(0.0), c.c_double(start),
                         c.c_bool(has_stop), end)

    def initialize(self, start=0.0, stop=None):
        return self.enter(start, stop) or self.call("ExitInitializationMode")

    def _numbers(self, word, names, values):
        count = len(names)
        references = (c.c_uint32 * count)(*(self.archive.reference.get(name, name) for name in names))
        more = [c.c_size_t(count)] if self.version == 3 else []
        kind = {2: "Real", 3: "Float64"}[self.version]
        return self.call(word + kind, references, c.c_size_t(count), values, *more)

    def try_set(self, values):
        return self._numbers("Set", list(values), (c.c_double * len(values))(*values.values()))

    def try_get(self, names):
        values = (c.c_double * len(names))()
        return self._numbers("Get", names, values), list(values)

    def get(self, names):
        status, values = self.try_get(names)
        assert status == OK, self.log
        return values

    def differentiate(self, unknowns, knowns, seeds, adjoint=False):
        """The status, and what the directional derivative is, or the adjoint one (FMI 3)."""
        def numbers(values):
            return (c.c_double * len(values))(*values)
        references = [(c.c_uint32 * len(names))(*(self.archive.reference.get(it, it) for it in names))
                      for names in (unknowns, knowns)]
        values = numbers([0.0] * len(knowns if adjoint else unknowns))
        more = [[c.c_size_t(len(it))] if self.version == 3 else [] for it in (seeds, values)]
        status = self.call("Get" + ("Adjoint" if adjoint else "Directional") + "Derivative", references[0],
                           c.c_size_t(len(unknowns)), references[1], c.c_size_t(len(knowns)), numbers(seeds), *more[0],
                           values, *more[1])
        return status, list(values)

    def mode(self, name):
        reference = (c.c_uint32 * 1)(self.archive.reference[name])
        value = (c.c_int * 1)() if self.version == 2 else (c.c_int64 * 1)()
        more = [c.c_size_t(1)] if self.version == 3 else []
        kind = {2: "Integer", 3: "Int64"}[self.version]
        assert self.call("Get" + kind, reference, c.c_size_t(1), value, *more) == OK, self.log
        return value[0]

    def step(self, at, length):
        """The status, and of FMI 3: event, end, early return and the time reached."""
        if self.version == 2:
            return self.call("DoStep", c.c_double(at), c.c_double(length), 1)
        flags = [c.c_bool() for _ in range(3)]
        self.reached = c.c_double()
        status = self.call("DoStep", c.c_double(at), c.c_double(length), c.c_bool(True),
                           *map(c.byref, flags), c.byref(self.reached))
        self.event, self.ends, self.early = (it.value for it in flags)
        self.reached = self.reached.value
        return status

    def state_name(self, word, end=""):
        return f"{word}FMU{'state' if self.version == 2 else 'State'}{end}"

    def copy(self, into=None):
        state = into or c.c_void_p()
        assert self.call(self.state_name("Get"), c.byref(state)) == OK
        return state

    def take(self, state):
        return self.call(self.state_name("Set"), state)

    def free_state(self, state):
        assert self.call(self.state_name("Free"), c.byref(state)) == OK
        assert not state

    def serialize(self, state):
        size = c.c_size_t()
        assert self.call(self.state_name("Serialized", "Size"), state, c.byref(size)) == OK
        data = (c.c_uint8 * size.value)()
        assert self.call(self.state_name("Serialize"), state, data, size) == OK
        return bytes(data)

    def deserialize(self, data):
        state = c.c_void_p()
        word = "DeSerialize" if self.version == 2 else "Deserialize"
        buffer = (c.c_uint8 * len(data)).from_buffer_copy(data)
        return self.call(self.state_name(word), buffer, c.c_size_t(len(data)), c.byref(state)), state
