"""Type stubs of the compiled modules, written from the signatures in their sources.

A parameter has its C type or its annotation, a result its annotation, and an attribute its C type
or a `# type:` comment. Comments `# overload: (…) -> …` in front of a function replace its
signature.

`setup.py` writes the stubs to build/stubs, where mypy finds them, and into wheels.
"""

import collections.abc
import re
import typing
from collections.abc import Iterator
from pathlib import Path

SOURCE = Path(__file__).parent / "src"
ARRAYS = "symcheck.kernels.arrays"

INTEGERS = {"int", "long", "long long", "int32_t", "int64_t", "Py_ssize_t"}
SCALARS = dict.fromkeys(INTEGERS, "int") | {"bint": "bool", "double": "float", "object": "Any"}
ELEMENTS = {
    "double": "Floats",
    "float": "Floats32",
    "int": "Int32s",
    "int32_t": "Int32s",
    "int64_t": "Int64s",
    "long long": "Int64s",
    "uint8_t": "Masks",
    "uint16_t": "UInt16s",
    "unsigned char": "Masks",
    "uint64_t": "Words",
    "unsigned long long": "Words",
}
RESULTS = {"__init__": "None", "__len__": "int", "__hash__": "int", "__bool__": "bool"}
RESULTS |= dict.fromkeys(["__eq__", "__le__", "__lt__", "__ge__", "__gt__"], "bool")
RESULTS |= {"__float__": "float", "__repr__": "str"}

FUSED = re.compile(r"^ctypedef fused (\w+):\n((?: +.*\n)+)", re.MULTILINE)
IMPORT = re.compile(r"^from (symcheck\.\S+) cimport (?:\(([^)]*)\)|(.*))$", re.MULTILINE)
ALIAS = re.compile(r"^(\w+): TypeAlias = \"(.*)\"$", re.MULTILINE)
ENUM = re.compile(r"^cpdef enum (\w+):\n((?: +.*\n|\n)+)", re.MULTILINE)
CLASS = re.compile(r"^cdef class (\w+)(?:\((\w+)\))?:", re.MULTILINE)
ATTRIBUTE = re.compile(
    r"^    cdef (?:readonly|public) ((?:const |unsigned |long )*\w+(?:\[.*?\])?) ([\w, ]+?)"
    r"(?: *#(?: type: )?(.*))?$",
    re.MULTILINE,
)
FUNCTION = re.compile(
    r"^(?P<indent> *)(?:def|cpdef \w+) (?P<name>\w+)\((?P<parameters>[^#]*?)\)"
    r"(?: -> (?P<result>[^\n]*?))?:(?: *# type: (?P<comment>.*))?$",
    re.MULTILINE,
)
PARAMETER = re.compile(
    r"(?:(?P<type>[\w ]*?\w(?:\[[:, 1]*\])?) +)?(?P<name>\*?\w+)(?: (?P<none>or|not) None)?"
    r"(?:: (?P<annotation>.*?))?(?: ?= ?(?P<default>[^=]*))?$",
    re.DOTALL,
)
OVERLOAD = re.compile(r"# overload: \((.*)\) -> (.*)")


def _text(path: Path) -> str:
    """A source with the files that it includes."""
    return re.sub(
        r'^include "(.*)"$',
        lambda match: _text(path.parent / match[1]),
        path.read_text(encoding="utf-8") if path.exists() else "",
        flags=re.MULTILINE,
    )


def _path(module: str, suffix: str) -> Path:
    return SOURCE / (module.replace(".", "/") + suffix)


def _split(parameters: str) -> Iterator[str]:
    """The parameters of a function, split at commas outside brackets."""
    depth = 0
    part = ""
    for character in " ".join(parameters.split()):
        depth += (character in "[({") - (character in "])}")
        if character == "," and depth == 0:
            yield part.strip()
            part = ""
        else:
            part += character
    if part.strip():
        yield part.strip()


class _Module:
    """The stub of one module."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.pxd = _text(path.with_suffix(".pxd"))
        self.pyx = _text(path)
        imported = IMPORT.findall(self.pxd + self.pyx)
        self.origin = {
            name: module
            for module, several, one in imported
            if _path(module, ".pyx").exists()
            for name in re.findall(r"\w+", several or one)
        }
        declarations = [self.pxd, self.pyx]
        declarations += [_text(_path(module, ".pxd")) for module in set(self.origin.values())]
        self.fused = {
            name: members.split() for name, members in FUSED.findall("\n".join(declarations))
        }

    def type_of(self, declared: str) -> str:
        """The Python type of a C type."""
        name = declared.removeprefix("const ")
        if "[" not in name:
            return SCALARS.get(name, name)
        element = name[: name.index("[")]
        members = self.fused.get(element, [element])
        return " | ".join(dict.fromkeys(ELEMENTS[member] for member in members))

    def parameter(self, text: str) -> str:
        match = PARAMETER.fullmatch(text)
        if match is None:
            raise ValueError(f"{self.path}: a parameter without a type: {text}")
        declared, name, none, annotation, default = match.groups()
        if name == "self":
            return "self"
        if annotation is None:
            annotation = self.type_of(declared) if declared else "Any"
        if none == "or" or (default == "None" and "None" not in annotation):
            annotation += " | None"
        return f"{name}: {annotation}" + (" = ..." if default else "")

    def functions(self, text: str, indent: str) -> Iterator[str]:
        """The public functions at a level of indentation."""
        matches = [m for m in FUNCTION.finditer(text) if m["indent"] == indent]
        names = {m["name"] for m in matches}
        for match in matches:
            name = match["name"]
            if name == "__cinit__" and "__init__" not in names:
                name = "__init__"
            if re.match(r"_[^_]|__cinit__|__dealloc__|__repr__", name):
                continue
            before = text[: match.start()].splitlines()
            decorators: list[str] = []
            while before and before[-1].strip().startswith(("@", "# overload")):
                decorators.insert(0, before.pop().strip())
            overloads = [o.groups() for line in decorators if (o := OVERLOAD.fullmatch(line))]
            for parameters, result in overloads:
                yield f"{indent}@overload\n{indent}def {name}({parameters}) -> {result}: ..."
            if overloads:
                continue
            if "@property" in decorators:
                yield f"{indent}@property"
            result = match["result"] or match["comment"] or RESULTS.get(name) or "None"
            body = re.match(rf"(?:{indent}    .*\n|\n)*", text[match.end() + 1 :])
            if result == "None" and body and re.search(r"^ +return \S", body[0], re.MULTILINE):
                raise ValueError(f"{self.path}: the result of {name} needs an annotation")
            parameters = ", ".join(map(self.parameter, _split(match["parameters"])))
            yield f"{indent}def {name}({parameters}) -> {result}: ..."

    def classes(self) -> Iterator[str]:
        starts = [*(m.start() for m in CLASS.finditer(self.pyx)), len(self.pyx)]
        for match, end in zip(CLASS.finditer(self.pyx), starts[1:], strict=True):
            name, base = match.groups()
            body = re.split(r"^(?=[^\s#)])", self.pyx[match.end() : end], flags=re.MULTILINE)[0]
            declared = re.search(
                rf"^cdef class {name}\b.*:\n((?: +.*\n|\n)+)", self.pxd, re.MULTILINE
            )
            lines = [
                f"    {attribute}: {comment if '# type:' in found[0] else self.type_of(ctype)}"
                for found in ATTRIBUTE.finditer((declared[1] if declared else "") + body)
                for ctype, attributes, comment in [found.groups()]
                for attribute in attributes.split(", ")
            ]
            lines += self.functions(body, "    ")
            yield f"class {name}{f'({base})' if base else ''}:"
            yield "\n".join(lines or ["    ..."])

    def stub(self) -> str:
        lines = [f"{name} = {value}" for name, value in ALIAS.findall(self.pyx)]
        for name, members in ENUM.findall(self.pxd + self.pyx):
            lines.append(f"class {name}(IntEnum):")
            names = re.findall(r"^ +(\w+)(?: = 0)?,?$", members, re.MULTILINE)
            lines += [f"    {member} = {i}" for i, member in enumerate(names)]
        lines += [*self.classes(), *self.functions(self.pyx, "")]
        used = set(re.findall(r"\w+", "\n".join(lines)))
        modules = {name: module for name, module in self.origin.items() if name in used}
        exported = re.findall(
            r"^(\w+) = ", _text(SOURCE / (ARRAYS.replace(".", "/") + ".py")), re.MULTILINE
        )
        modules |= {name: ARRAYS for name in exported if name in used}
        for module in (typing, collections.abc):
            modules |= {n: module.__name__ for n in module.__all__ if n in used and n[0] != "_"}
        others = {"ArrayLike": "numpy.typing", "Executor": "concurrent.futures", "IntEnum": "enum"}
        modules |= {name: module for name, module in others.items() if name in used}
        imports = [f"from {module} import {name}" for name, module in sorted(modules.items())]
        return "\n".join([*imports, *lines, ""])


def write_stubs(target: Path) -> None:
    """Write the stub of each compiled module below `target`."""
    for path in SOURCE.rglob("*.pyx"):
        out = target / path.relative_to(SOURCE).with_suffix(".pyi")
        out.parent.mkdir(parents=True, exist_ok=True)
        out.write_text(_Module(path).stub(), encoding="utf-8")


if __name__ == "__main__":
    write_stubs(Path("build/stubs"))
