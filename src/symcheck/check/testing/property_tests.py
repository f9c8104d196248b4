"""Tests of properties: their results compared with RESULT lines, as values and as reports."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, overload

from symcheck.check.property_instance import PropertyInstance
from symcheck.check.result import Result, show_value
from symcheck.check.testing.expected_results import Verdict, VerdictKind, expected_value, judge
from symcheck.constant_values import GivenConstants
from symcheck.errors import UsageError
from symcheck.lazy_dataclass import dataclass
from symcheck.semantics.model import Value
from symcheck.tables import Table, Tabular
from symcheck.whole_file import write_whole

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element  # XML and JSON are imported where a report is written

__all__ = ["PropertyTest", "PropertyTests", "check_report_file", "property_test"]

_NO_XML = "[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]"
_FAILURES = (VerdictKind.FAIL, VerdictKind.UNSUPPORTED)


@dataclass(frozen=True)
class PropertyTest:
    """The test of one property for one choice of constants.

    Attributes:
        name: that of the property, or its text if it has none.
        constants: the given values of the constants, as texts.
        expected: the value of the RESULT line; None if there is none.
        result: the value, or the first line of the error.
        verdict: whether they agree.
        seconds: time of the check.
        file, line: the place of the property; the line is counted from 1.
    """

    name: str
    constants: Mapping[str, str]
    expected: str | None
    result: str
    verdict: Verdict
    seconds: float = 0.0
    file: str = ""
    line: int = 0

    @property
    def title(self) -> str:
        """Name and constants."""
        given = ",".join(f"{n}={v}" for n, v in self.constants.items())
        return f"{self.name} ({given})" if given else self.name

    @property
    def failed(self) -> bool:
        """Whether the result differs from the expected one, or the property is not supported."""
        return self.verdict.kind in _FAILURES


def property_test(
    instance: PropertyInstance,
    outcome: Result | Exception,
    given: GivenConstants,
    constants: Mapping[str, Value],
    *,
    exact: bool = False,
) -> PropertyTest:
    """Compare the result of a property with the RESULT lines above it.

    Args:
        instance: the property.
        outcome: its result, or the error that was raised instead.
        given: the given constants of the model.
        constants: all known constants, of the model and the properties.
        exact: arithmetic was rational: numbers must be equal.
    """
    written = instance.file.properties[instance.index]
    if isinstance(outcome, Result):
        shown, seconds = show_value(outcome.value), outcome.seconds
    else:
        shown, seconds = str(outcome).partition("\n")[0], 0.0
    return PropertyTest(
        instance.title,
        {n: str(v) for n, v in {**given, **instance.relevant}.items()},
        expected_value(written.comments, constants),
        shown,
        judge(written.comments, outcome, constants, exact=exact),
        seconds,
        written.span.source.name,
        written.span.source.position(written.span.start)[0],
    )


@dataclass(frozen=True, repr=False)
class PropertyTests(Sequence[PropertyTest], Tabular):
    """The tests of a run, in order; `ok` says whether none failed.

    Attributes:
        tests: one for each property and choice of constants.
        name: of the model and the properties.
        error: the error that ended the run; None if it came to its end.
    """

    tests: tuple[PropertyTest, ...]
    name: str = ""
    error: str | None = None

    @overload
    def __getitem__(self, index: int) -> PropertyTest: ...
    @overload
    def __getitem__(self, index: slice) -> PropertyTests: ...
    def __getitem__(self, index: int | slice) -> PropertyTest | PropertyTests:
        if isinstance(index, slice):
            return replace(self, tests=self.tests[index])
        return self.tests[index]

    def __len__(self) -> int:
        return len(self.tests)

    def _of(self, *kinds: VerdictKind) -> tuple[PropertyTest, ...]:
        return tuple(t for t in self.tests if t.verdict.kind in kinds)

    @property
    def passed(self) -> tuple[PropertyTest, ...]:
        """The tests whose result is the expected one."""
        return self._of(VerdictKind.PASS)

    @property
    def failed(self) -> tuple[PropertyTest, ...]:
        """The tests with another result, and those of properties that are not supported."""
        return self._of(*_FAILURES)

    @property
    def not_tested(self) -> tuple[PropertyTest, ...]:
        """The properties without an expected result; their verdicts say why."""
        return self._of(VerdictKind.NOT_TESTED)

    @property
    def ok(self) -> bool:
        """Whether no test failed, and no error ended the run."""
        return not self.failed and self.error is None

    def __repr__(self) -> str:
        return f"<PropertyTests: {self.summary}>"

    @property
    def summary(self) -> str:
        """How many passed, failed and were not tested, and why the latter were not."""
        text = f"{len(self.passed)} passed, {len(self.failed)} failed"
        reasons = Counter(t.verdict.message for t in self.not_tested)
        if reasons:
            why = "; ".join(f"{n}: {reason}" for reason, n in reasons.items())
            text += f", {len(self.not_tested)} not tested ({why})"
        return text + (", ended by an error" if self.error is not None else "")

    def _table(self) -> Table:
        rows = [(t.title, t.expected or "", t.result, t.verdict) for t in self.tests]
        return Table.of(("property", "expected", "result", "verdict"), rows, self.summary)

    def columns(self) -> dict[str, Sequence[object]]:
        """The fields of the tests by name; the first column numbers them from 1."""
        return {
            "test": list(range(1, len(self) + 1)),
            "property": [t.name for t in self.tests],
            **{
                n if n not in _COLUMNS else f"constant {n}": [t.constants.get(n) for t in self]
                for n in dict.fromkeys(n for t in self.tests for n in t.constants)
            },
            "expected": [t.expected for t in self.tests],
            "result": [t.result for t in self.tests],
            "verdict": [t.verdict.kind.value for t in self.tests],
            "message": [t.verdict.message for t in self.tests],
            "seconds": [t.seconds for t in self.tests],
        }

    def save(self, path: str | Path) -> None:
        """Write a report, whole or not at all: JUnit XML (.xml), which CI services read, or JSON.

        Raises UsageError: the extension is another one, or the file cannot be written.
        """
        extension = check_report_file(path)
        write_whole(path, partial(_write_junit if extension == ".xml" else _write_json, self))


_COLUMNS = ("test", "property", "expected", "result", "verdict", "message", "seconds")


def check_report_file(path: str | Path) -> str:
    """The extension of a report, .xml or .json. Raises UsageError."""
    extension = Path(path).suffix.lower()
    if extension not in (".xml", ".json"):
        raise UsageError(
            f"'{path}': the extension says how tests are written, and it is neither .xml (JUnit) "
            "nor .json"
        )
    return extension


def _write_json(tests: PropertyTests, path: Path) -> None:
    import json

    columns = tests.columns()
    origins = {"file": [t.file for t in tests], "line": [t.line for t in tests]}
    table = {**columns, **origins}
    rows = [dict(zip(table, row, strict=True)) for row in zip(*table.values(), strict=True)]
    content = {
        "name": tests.name,
        "passed": len(tests.passed),
        "failed": len(tests.failed),
        "not tested": len(tests.not_tested),
        "error": tests.error,
        "tests": rows,
    }
    path.write_text(json.dumps(content, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def _write_junit(tests: PropertyTests, path: Path) -> None:
    """The format that JUnit's Ant task introduced: a failure is an assertion that does not hold, an
    error anything else.
    """
    from xml.etree.ElementTree import ElementTree, indent

    unsupported = sum(t.verdict.kind is VerdictKind.UNSUPPORTED for t in tests)
    ended = tests.error is not None
    counts = {
        "tests": len(tests) + ended,
        "failures": len(tests.failed) - unsupported,
        "errors": unsupported + ended,
        "skipped": len(tests.not_tested),
        "time": f"{sum(t.seconds for t in tests):.3f}",
    }
    suite = _element(None, "testsuite", name=tests.name, **counts)
    for t in tests:
        origin = {"classname": t.file, "file": t.file, "line": t.line}
        case = _element(suite, "testcase", name=t.title, time=f"{t.seconds:.3f}", **origin)
        match t.verdict.kind:
            case VerdictKind.FAIL:
                _element(case, "failure", message=t.verdict.message)
            case VerdictKind.UNSUPPORTED:
                _element(case, "error", message=t.verdict.message, type="unsupported")
            case VerdictKind.NOT_TESTED:
                _element(case, "skipped", message=t.verdict.message)
            case VerdictKind.PASS:
                pass
        _element(case, "system-out").text = _clean(f"Result: {t.result}")
    if tests.error is not None:
        case = _element(suite, "testcase", name="the run", classname=tests.name, time="0")
        _element(case, "error", message=tests.error, type="error")
    root = _element(None, "testsuites", **counts)
    root.append(suite)
    indent(root)
    ElementTree(root).write(path, encoding="utf-8", xml_declaration=True)


def _element(parent: Element | None, tag: str, **attributes: object) -> Element:
    from xml.etree.ElementTree import Element, SubElement

    texts = {name: _clean(str(value)) for name, value in attributes.items()}
    return Element(tag, texts) if parent is None else SubElement(parent, tag, texts)


def _clean(text: str) -> str:
    """A text without the characters that XML cannot have."""
    return re.sub(_NO_XML, "\ufffd", text)
