"""Packages, compiled extensions and their stubs; everything else is in pyproject.toml."""

import os
import sys
from pathlib import Path

from Cython.Build import cythonize
from setuptools import Extension, find_packages, setup
from setuptools.command.build_py import build_py

sys.path.insert(0, str(Path(__file__).parent))
from stubs import write_stubs  # build backends do not look into this folder


class BuildWithStubs(build_py):
    def run(self) -> None:
        super().run()
        if not self.editable_mode:
            write_stubs(Path(self.build_lib))


extensions = [
    Extension(
        ".".join(path.relative_to("src").with_suffix("").parts),
        [str(path)],
        # -ffp-contract=off: processors with fused multiply-add give the same digits as others.
        # -g0: no debugging symbols, which would double the time to compile and the size of a wheel.
        extra_compile_args=["-O3", "-g0", "-fno-math-errno", "-ffp-contract=off"],
        libraries=["dl"] if sys.platform == "linux" else [],
    )
    for path in sorted(Path("src").rglob("*.pyx"))
]

write_stubs(Path("build/stubs"))  # for mypy
setup(
    packages=[*find_packages("src"), "symcheck.grammar"],
    ext_modules=cythonize(
        extensions, language_level=3, compiler_directives={"annotation_typing": False}
    ),
    cmdclass={"build_py": BuildWithStubs},
    options={"build_ext": {"parallel": os.cpu_count() or 1}},
)
