"""Packages and compiled extensions; everything else is in pyproject.toml."""

import os
from pathlib import Path

from Cython.Build import cythonize
from setuptools import Extension, find_packages, setup

extensions = [
    Extension(
        ".".join(path.relative_to("src").with_suffix("").parts),
        [str(path)],
        # -g0: no debugging symbols, which would double the time to compile and the size of a wheel.
        extra_compile_args=["-O3", "-g0", "-fno-math-errno"],
        libraries=["dl"],
    )
    for path in sorted(Path("src").rglob("*.pyx"))
]

setup(
    packages=[*find_packages("src"), "symcheck.grammar"],
    ext_modules=cythonize(extensions, language_level=3),
    options={"build_ext": {"parallel": os.cpu_count() or 1}},
)
