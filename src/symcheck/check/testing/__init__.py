"""Tests of properties: RESULT lines, verdicts, and reports."""
