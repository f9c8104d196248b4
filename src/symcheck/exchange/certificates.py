"""The files of a certificate: the certificate as JSON, and the model that it is about."""

from __future__ import annotations

import hashlib
import json
import re
import sys
from functools import partial
from pathlib import Path

from symcheck.check.certificate import Certificate
from symcheck.errors import UsageError
from symcheck.exchange import export
from symcheck.exchange.explicit_export import explicit_export
from symcheck.whole_file import write_whole

__all__ = ["certificate_extension", "save_certificate"]

_HEADING = re.compile(r'# Reward structure "([^"]*)"')


def certificate_extension(path: str | Path) -> str:
    """The extension of a certificate: .json. Raises UsageError."""
    if Path(path).suffix != ".json":
        raise UsageError(f"'{path}': a certificate is a .json file")
    return ".json"


def save_certificate(certificate: Certificate, path: str | Path) -> list[str]:
    """Write FILE.json, and FILE.tra, FILE.lab and the rewards, whose numbers are fractions.

    Returns:
        The names of the files, that of the certificate first.

    Raises:
        UsageError: the name does not end in .json, or a file cannot be written.
    """
    certificate_extension(path)
    file = Path(path)
    engine = certificate.model
    names = tuple(engine.model.labels)
    of_label = engine.model.labels.__getitem__
    whole = explicit_export(engine, names, lambda name: engine.where(of_label(name)))
    exported = whole.without_actions()  # the checker reads no names, which take long to find
    targets = export.parse_target(f"{file.with_suffix('')}.tra,lab,srew,trew", "")
    written = list(export.export(exported, targets, sys.stdout))
    about = {
        "type": engine.model.type.value,
        "numbers": "rational",
        "sha256": dict(map(_digest, written)),
    }
    content = {
        "certificate": 1,
        "property": certificate.formula,
        "model": about,
        "statement": certificate.statement,
        "evidence": certificate.evidence,
    }
    write_whole(file, partial(_write, json.dumps(content) + "\n"))
    return [str(file), *written]


def _digest(path: str) -> tuple[str, str]:
    """The name of a file for the checker, and the digest of its text."""
    text = Path(path).read_text(encoding="utf-8")
    found = _HEADING.match(text)
    name = Path(path).suffix + (f" {found.group(1)}" if found else "")
    return name.strip(), hashlib.sha256(text.encode()).hexdigest()


def _write(text: str, path: Path) -> None:
    path.write_text(text, encoding="utf-8")
