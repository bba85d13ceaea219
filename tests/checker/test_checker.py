"""Verification against the small corpus: sound pools are accepted, false claims noticed, each for its reason."""

import json
import math
import random
import subprocess
import sys
from pathlib import Path

import pytest
from checkers import CONTROLS, EASY
from helpers import of_stored_pools
from make_base import BASE, KEPT, POOLS, outdated
from make_corpus import cases, write

from scengen import list_tasks, load_task
from scengen.pool import Pool
from scengen.validate.verify.claims import alike
from scengen.validate.verify.spot import excluded_share

RUN = Path(__file__).parent / "run_corpus.py"


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    """What verification and the controls make of the small corpus."""
    folder = tmp_path_factory.mktemp("checker")
    told = ["--json", folder / "report.json", "--pools", folder / "pools", "--checker", "scengen", *CONTROLS]
    subprocess.run([sys.executable, RUN, "--quick", *told], capture_output=True)
    return json.loads((folder / "report.json").read_text())


def test_the_corpus_is_large_and_covers_every_task():
    corpus = cases()
    expected = [case.expect for case in corpus]
    assert expected.count("accept") >= 20 and expected.count("reject") + expected.count("refuse") >= 120
    tasks = {arguments[0].removeprefix("task=") for arguments in POOLS.values()}
    assert tasks == set(list_tasks())
    for expect in ("accept", "reject"):
        assert {POOLS[case.base][0] for case in corpus if case.expect == expect} == {f"task={task}" for task in tasks}


@pytest.mark.parametrize("name", KEPT)
def test_the_pools_in_the_repository_are_those_of_the_families_as_they_are(name):
    pool = Pool.open(BASE / name)
    task = load_task(pool.task)
    remedy = "make checker-base"
    assert not outdated(BASE / name), remedy
    for row in pool.rows():
        scenario = task.scenario(row.params)
        assert (scenario.id, alike(scenario.features(), row.certificate.checks[0].numbers)) == (row.id, True), remedy


@pytest.mark.slow
def test_the_whole_corpus_can_be_made(tmp_path):
    """Every base still has what its false claims are made of: rejects, for instance."""
    write(cases(), tmp_path / "corpus", tmp_path / "pools")


@pytest.mark.slow
@of_stored_pools
def test_every_pool_gets_the_verdict_that_it_deserves_and_the_reason(report):
    wrong = {o["name"]: (o["why"], o["text"][-400:]) for o in report["outcomes"]["scengen"] if o["why"]}
    assert not wrong
    assert len(report["outcomes"]["scengen"]) >= 40


@pytest.mark.slow
@of_stored_pools
def test_no_control_does_well(report):
    """Else the corpus would not test what verification is for."""
    scores = {score["checker"]: score for score in report["scores"]}
    assert scores["scengen"]["soundness"] == scores["scengen"]["completeness"] == 1.0
    assert all(scores[name]["soundness"] < EASY for name in CONTROLS)


@pytest.mark.parametrize(("total", "sample"), [(50, 10), (400, 59), (5000, 300)])
def test_a_sample_without_a_false_row_excludes_the_share_that_it_says(total, sample):
    """Simulated with the seeds of many verifiers: at that share a sample misses every false row in at most 5 %."""
    share = excluded_share(total, sample)
    times, false = 4000, math.ceil(share * total - 1e-9)
    spread = 3 * math.sqrt(0.05 * 0.95 / times)

    def missed(count):
        """How often a sample meets none of the rows that an author has forged without knowing the seed."""
        forged = set(random.Random(total).sample(range(total), count))
        samples = (random.Random(seed).sample(range(total), sample) for seed in range(times))
        return sum(forged.isdisjoint(chosen) for chosen in samples) / times

    assert missed(false) <= 0.05 + spread
    assert missed(false - 1) > 0.05 - spread  # and no smaller share is excluded
