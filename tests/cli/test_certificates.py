"""Certificates are printed as people read them."""

from dataclasses import replace

from helpers import REFERENCE

from scengen.cli.certificates import certificate_table
from scengen.cli.tables import in_words
from scengen.pool import Pool
from scengen.validate.words import found


def check(row, name):
    return next(one for one in row.certificate.checks if one.name == name)


def lines(row):
    table = certificate_table(row)
    return dict(zip(table.columns[0].cells, table.columns[2].cells, strict=True))


def test_each_check_is_a_sentence_with_units_and_each_shortcut_a_row():
    row = next(Pool.open(REFERENCE).rows())
    told = lines(row)
    assert told["robust"] == "4 of 4 jittered runs succeed: at least 47% of all, with 95 % confidence"
    assert told["rest"] == "bodies move 0.007 mm and turn 0.000 deg at most in 2 s without actions"
    assert told["solved"].startswith("the oracle reaches the goal after ")
    slab = told["  push_the_slab"]
    assert slab.count("the robot touched the slab") == 1 and "filtered after" in slab and "raw after" in slab
    assert {f"  {name}" for name in check(row, "shortcuts").numbers} <= told.keys()
    assert not any("e-" in text or "{" in text or ".4728" in text for text in told.values())


def test_numbers_that_no_words_fit_are_shown_by_name():
    row = next(Pool.open(REFERENCE).rows())
    odd = replace(check(row, "robust"), numbers={"runs": "all", "more": 0.123456})
    assert found(odd) == "runs all, more 0.123"
    broken = replace(check(row, "shortcuts"), numbers={"push": 3})
    certificate = replace(row.certificate, checks=(broken,))
    assert lines(replace(row, certificate=certificate))["  push"] == "3"


def test_a_reason_of_the_rejection_report_has_no_signs_for_numbers():
    assert in_words("robust: # of # jittered runs succeed; run #: tile_# fell") == (
        "robust: too few jittered runs succeed; run N: tile_N fell"
    )
