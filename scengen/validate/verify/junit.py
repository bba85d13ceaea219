"""Reports of verification as JUnit XML: a test for every scenario, a failure for a refuted one.

A declined scenario is an error, and one that was not simulated is skipped.
"""

import re
import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from ...installation import versions
from .findings import Report

SKIPPED = "skipped"
"""Verdict on a scenario that was not simulated."""
KINDS = {"refuted": "failure", "declined": "error", SKIPPED: "skipped"}
"""Kinds of JUnit by verdict."""
_UNWRITABLE = re.compile("[^\t\n\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""Characters that XML 1.0 cannot hold."""


def junit(reports: Mapping[str, Report | str], level: str) -> str:
    """Text of a file for CI systems, with a suite for each pool.

    Args:
        reports: reports by the name of the pool; for a pool that could not be verified, the reason.
        level: level of the verification.
    """
    suites = ET.Element("testsuites")
    for pool, report in reports.items():
        if isinstance(report, str):
            suites.append(_suite(pool, {"level": level}, [{"id": "pool", "verdict": "declined", "reason": report}]))
        else:
            suites.append(_suite(pool, _about(report), [*_cases(report)]))
    ET.indent(suites)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(suites, encoding="unicode") + "\n"


def _about(report: Report) -> dict[str, Any]:
    """Properties of a suite."""
    sample = {f"sample_{key}": value for key, value in (report.sample or {}).items()}
    return {"level": report.level, "settings": report.settings, "pool_sha256": report.pool_sha256, **sample}


def _cases(report: Report) -> Iterator[Mapping[str, Any]]:
    """Everything that is a test: faults of the pool as a whole, scenarios, and all scenarios that were not read."""
    scenarios = {e["id"] for e in report.examinations}
    yield from (fault for fault in report.failed if fault["id"] not in scenarios)
    for one in report.examinations:
        unseen = one["verdict"] == "sound" and not one["simulated"]
        yield {**one, "verdict": SKIPPED, "reason": "not in the sample: checked without simulation"} if unseen else one
    if report.sample and (others := report.sample["of"] - report.checked):
        yield {"id": f"{others} other scenarios", "verdict": SKIPPED, "reason": "not in the sample: not checked"}


def _suite(pool: str, about: Mapping[str, Any], cases: Sequence[Mapping[str, Any]]) -> ET.Element:
    name, kinds = _written(pool), Counter(KINDS.get(case["verdict"]) for case in cases)
    counts = {"failures": kinds["failure"], "errors": kinds["error"], "skipped": kinds["skipped"]}
    numbers = {"tests": len(cases), **counts, "time": _seconds(sum(case.get("seconds") or 0.0 for case in cases))}
    suite = ET.Element("testsuite", {"name": f"scengen verify {name}", **{k: str(v) for k, v in numbers.items()}})
    properties = ET.SubElement(suite, "properties")
    for key, value in {**about, **versions()}.items():
        ET.SubElement(properties, "property", {"name": key, "value": _written(str(value))})
    for case in cases:
        time = {} if case.get("seconds") is None else {"time": _seconds(case["seconds"])}
        test = ET.SubElement(suite, "testcase", {"classname": name, "name": _written(case["id"]), **time})
        if kind := KINDS.get(case["verdict"]):
            reason = _written(case["reason"])
            ET.SubElement(test, kind, {"type": case["verdict"], "message": reason[:300]}).text = reason
    return suite


def _seconds(value: float) -> str:
    return f"{value:.3f}"


def _written(text: str) -> str:
    return _UNWRITABLE.sub("?", text)
