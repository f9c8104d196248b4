"""Packages, compiled extensions and their stubs; everything else is in pyproject.toml."""

import os
import sys
from multiprocessing import get_start_method
from pathlib import Path

import numpy
from Cython.Build import cythonize
from setuptools import Extension, find_packages, setup
from setuptools.command.build_ext import build_ext
from setuptools.command.build_py import build_py

sys.path.insert(0, str(Path(__file__).parent))
from stubs import write_stubs  # build backends do not look into this folder


class BuildWithStubs(build_py):
    def run(self) -> None:
        super().run()
        if not self.editable_mode:
            write_stubs(Path(self.build_lib))


HEADERS = "src/symcheck/kernels"
UTILITIES = "symcheck.kernels.cython_utilities"
"""The module with the code of memoryviews. Cython would otherwise write it into each module, which
more than doubles the time to compile."""
MEMORY = "symcheck.kernels.file_memory"
"""The module that gives numpy memory, and needs its headers."""


class BuildExtensions(build_ext):
    """Options in the words of the compiler.

    Processors with fused multiply-add give the same digits as others: compilers must not contract
    expressions. Debugging symbols would double the time to compile and the size of a wheel.
    """

    def build_extensions(self) -> None:
        unix = ["-O3", "-g0", "-fno-math-errno", "-ffp-contract=off"]
        for extension in self.extensions:
            extension.extra_compile_args = (
                ["/O2", "/fp:precise"] if self.compiler.compiler_type == "msvc" else unix
            )
        super().build_extensions()


def extension(module: str, suffix: str) -> Extension:
    file = f"src/{module.replace('.', '/')}{suffix}"
    folders = [HEADERS, *([numpy.get_include()] if module == MEMORY else [])]
    return Extension(module, [file], include_dirs=folders, depends=[f"{HEADERS}/portable.h"])


modules = sorted(
    ".".join(path.relative_to("src").with_suffix("").parts) for path in Path("src").rglob("*.pyx")
)
write_stubs(Path("build/stubs"))  # for mypy
setup(
    packages=[*find_packages("src"), "symcheck.grammar"],
    ext_modules=cythonize(
        [*(extension(module, ".pyx") for module in modules), extension(UTILITIES, ".c")],
        language_level=3,
        compiler_directives={"annotation_typing": False},
        shared_utility_qualified_name=UTILITIES,
        # A process that is not forked would run this file again.
        nthreads=(os.cpu_count() or 1) if get_start_method() == "fork" else 0,
    ),
    cmdclass={"build_ext": BuildExtensions, "build_py": BuildWithStubs},
    options={"build_ext": {"parallel": os.cpu_count() or 1}},
)
