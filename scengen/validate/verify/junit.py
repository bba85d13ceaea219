"""Reports of verification as JUnit XML: a test for every scenario, a failure for a refuted one."""

import re
import xml.etree.ElementTree as ET
from collections.abc import Mapping

from ...installation import versions
from .findings import Report

_UNWRITABLE = re.compile("[^\t\n\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""Characters that XML 1.0 cannot hold."""


def junit(reports: Mapping[str, Report]) -> str:
    """Text of a file for CI systems, with a suite for each pool.

    Args:
        reports: reports by the name of the pool.
    """
    suites = ET.Element("testsuites")
    suites.extend(_suite(pool, report) for pool, report in reports.items())
    ET.indent(suites)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(suites, encoding="unicode") + "\n"


def _suite(pool: str, report: Report) -> ET.Element:
    name = _UNWRITABLE.sub("?", pool)
    scenarios = {e["id"] for e in report.examinations}
    of_pool = [f for f in report.failed if f["id"] not in scenarios]
    tests = [*of_pool, *report.examinations]
    counts = {kind: sum(t["verdict"] == kind for t in tests) for kind in ("refuted", "declined")}
    suite = ET.Element("testsuite", {
        "name": f"scengen verify {name}", "tests": str(len(tests)), "failures": str(counts["refuted"]),
        "errors": str(counts["declined"]), "skipped": "0",
    })  # fmt: skip
    about = {"level": report.level, "settings": report.settings, **(report.sample or {}), **versions()}
    properties = ET.SubElement(suite, "properties")
    for key, value in about.items():
        ET.SubElement(properties, "property", {"name": key, "value": _UNWRITABLE.sub("?", str(value))})
    for test in tests:
        case = ET.SubElement(suite, "testcase", {"classname": name, "name": _UNWRITABLE.sub("?", test["id"])})
        if test["verdict"] != "sound":
            kind = "failure" if test["verdict"] == "refuted" else "error"
            reason = _UNWRITABLE.sub("?", test["reason"])
            ET.SubElement(case, kind, {"type": test["verdict"], "message": reason[:300]}).text = reason
    return suite
