"""A folder for the Hugging Face Hub says what is in it, as `datasets` reads it, and holds only what verifies."""

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path

import pyarrow.parquet as pq
import pytest
import yaml
from helpers import REFERENCE, certified_here
from pools import certificate_of, rewritten

from scengen import cli
from scengen.certificate import CHECKS
from scengen.errors import PoolError
from scengen.export import hub
from scengen.pool import Pool

BASE = Path(__file__).parents[1] / "checker" / "base"
POOLS = (BASE / "single_severity", BASE / "mirror_id")
"""Of a quick task each, one scenario."""


def card(*pools, to, **settings):
    given = [f"{name}={value}" for name, value in settings.items()]
    return cli.run(["export", "hub", f"pool={','.join(map(str, pools))}", f"to={to}", *given])


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    certified_here(POOLS[0])
    folder = tmp_path_factory.mktemp("hub") / "data"
    assert card(*POOLS, to=folder, license="cc-by-4.0") == 0
    return folder


@pytest.fixture(scope="module")
def head(made):
    text = (made / "README.md").read_text()
    assert text.startswith("---\n")
    return yaml.safe_load(text.split("---\n")[1])


def test_there_is_one_configuration_for_each_split_and_its_files_are_there(made, head):
    found = {config["config_name"]: config["data_files"] for config in head["configs"]}
    assert list(found) == ["domino_single-wide_gaps@2", "mirror_pick_place-id"]
    assert [files[0]["split"] for files in found.values()] == ["test", "train"], "training is train, axes are test"
    assert [config.get("default") for config in head["configs"]] == [None, True]
    for files in found.values():
        assert all((made / path).is_file() for path in files[0]["path"])


def test_columns_and_sizes_are_those_of_the_parquet_files(made, head):
    for config, info in zip(head["configs"], head["dataset_info"], strict=True):
        assert info["config_name"] == config["config_name"]
        paths = [made / path for path in config["data_files"][0]["path"]]
        schema = pq.read_schema(paths[0])
        assert [feature["name"] for feature in info["features"]] == schema.names
        for feature in info["features"]:
            assert_same(feature, schema.field(feature["name"]).type)
        (split,) = info["splits"]
        assert split["num_examples"] == sum(pq.read_metadata(path).num_rows for path in paths)
        assert info["download_size"] == sum(path.stat().st_size for path in paths)
    assert head["size_categories"] == ["n<1K"] and head["license"] == "cc-by-4.0"


def assert_same(feature, kind):
    """A column in the words of `datasets` and its Arrow type, all the way down."""
    if "struct" in feature:
        assert [inner["name"] for inner in feature["struct"]] == kind.names
        for inner in feature["struct"]:
            assert_same(inner, kind.field(inner["name"]).type)
    elif "list" in feature:
        assert feature.get("length", -1) == getattr(kind, "list_size", -1)
        inner = feature["list"]
        told = {"dtype": inner} if isinstance(inner, str) else {"struct": inner} if isinstance(inner, list) else inner
        assert_same(told, kind.value_type)
    else:
        assert feature["dtype"] == {"double": "float64", "float": "float32"}.get(str(kind), str(kind))


def test_the_pools_are_there_byte_by_byte(made):
    for folder, name in zip(POOLS, ("domino_single-wide_gaps@2", "mirror_pick_place-id"), strict=True):
        assert Pool.open(made / name).check().sha256 == Pool.open(folder).sha256


def test_people_read_what_was_certified_and_how_it_was_verified(made):
    text = (made / "README.md").read_text().split("---\n", 2)[2]
    for name in CHECKS:
        assert re.search(rf"^\| {name} \| {re.escape(hub.CHECK_MEANINGS[name])} \|", text, re.M), name
    assert set(hub.CHECK_MEANINGS) == set(CHECKS)
    assert "level replay" in text and "Not measured" in text and "@software{scengen," in text
    assert Pool.open(POOLS[0]).sha256 in text and "| `domino_single` | `wide_gaps` | Tiles still reach" in text


def test_text_of_a_pool_is_no_markup():
    texts = ["<img src=x onerror=alert(1)>", "a | b", "`x`", "[x](http://y)", "two\nlines", "\x1b[2J"]
    cells = [*texts, hub._code("a`|<b>")]
    table = hub._table(["name"], [[cell] for cell in cells])
    assert table.splitlines()[2:] == [
        r"| \<img src=x onerror=alert(1)\> |", r"| a \| b |", r"| \`x\` |", r"| \[x\](http://y) |", r"| two\\nlines |",
        r"| \\x1b\[2J |", "| `a__<b>` |",
    ]  # fmt: skip


@pytest.mark.parametrize("where", ["rates", "hits"])
@pytest.mark.parametrize("tier", ["<b>sure</b>", "random |", "random\n", "x" * 101, 7, None])
def test_a_tier_of_a_pool_is_a_word(tmp_path, where, tier):
    folder = shutil.copytree(POOLS[0], tmp_path / "pool")
    manifest = json.loads((folder / "manifest.json").read_text())
    entry = {"tier": tier, "raw": False, "rollouts": 1, "hits": 0, "file": "hits/a.npz", "sha256": "0" * 64}
    manifest["attack"] = {"rates": [], "hits": [], where: [entry]}
    (folder / "manifest.json").write_text(json.dumps(manifest))
    with pytest.raises(PoolError, match="tier of a"):
        Pool.open(folder)


def test_accessibility_adds_up_hits_of_checks():
    row = next(Pool.open(POOLS[0]).rows())
    numbers = {"random_raw": {"rollouts": 30, "hits": 1}, "retry_filtered": {"rollouts": 10, "hits": 0}}
    checks = [replace(c, passed=True, numbers=numbers) if c.name == "attack" else c for c in row.certificate.checks]
    published = hub.PublishedPool(Pool.open(POOLS[0]), "quick", "")
    lines = hub._accessibility([published], [hub.Tally.of([replace(row.certificate, checks=tuple(checks))] * 2)])
    assert lines == [
        ["`domino_single-wide_gaps@2`", "`random`", "raw", "2 of 60", "< 10.1%"],
        ["`domino_single-wide_gaps@2`", "`retry`", "filtered", "0 of 20", "< 13.9%"],
    ]


def test_a_certificate_that_does_not_hold_gets_no_card(tmp_path, capsys):
    certified_here(POOLS[0])
    shutil.copytree(POOLS[0], tmp_path / "false")
    rewritten(tmp_path / "false", lambda row: certificate_of(row, final_state="0" * 16))
    assert card(tmp_path / "false", to=tmp_path / "out") == 2
    err = capsys.readouterr().err.splitlines()[-1]
    assert "false is refuted at level replay: domino_single/wide_gaps@2@" in err
    assert "only pools that verify are published, see scengen verify pool=" in err and not (tmp_path / "out").exists()


def test_a_repeated_command_finds_its_folder_and_another_one_is_refused(made, capsys, tmp_path):
    copied = shutil.copytree(made, tmp_path / "copy")
    assert card(*POOLS, to=copied, license="cc-by-4.0") == 0
    assert "copy holds this data set already: README.md and 2 scenarios" in capsys.readouterr().out
    assert card(*POOLS, to=copied, license="mit") == 2
    assert "is not empty: it holds README.md; delete it, or name another folder" in capsys.readouterr().err
    assert card(POOLS[0], to=copied) == 2
    assert "is not empty: it holds mirror_pick_place-id" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ([], "export hub needs pool=...; see scengen export hub --help"),
        (["pool=nowhere"], "no pool at nowhere"),
        (
            [f"pool={REFERENCE}", f"to={REFERENCE}"],
            "is not empty: it holds manifest.json; delete it, or name another folder",
        ),
        ([f"pool={REFERENCE}", "level=all"], "level = all; it must be replay or recheck or full"),
        (
            [f"pool={REFERENCE},{BASE / 'single_quick'}"],
            "are both domino_single-id; give one pool of each task and split",
        ),
        ([f"pool={REFERENCE}", "licence=mit"], "no setting of export hub named 'licence' (did you mean 'license'?)"),
    ],
)
def test_bad_input_is_one_line_and_writes_nothing(tmp_path, capsys, arguments, says):
    assert cli.run(["export", "hub", f"to={tmp_path / 'out'}", *arguments]) == 2
    err = capsys.readouterr().err
    assert says in err and err.count("\n") == 1 and not list(tmp_path.iterdir())
