"""An error in the code of a task or a policy names its file and line, in the main process and in workers."""

import pickle

import pytest

from scengen import cli
from scengen.cli.commands import tasks
from scengen.errors import UnknownName, place_of
from scengen.work.parallel import portable

TASK = """
family: {module}.Mine
code: X90
category: P3
instruction: Make the red slab fall by pushing the first tile.
horizon: 6.0
id:
  x: [uniform, -0.05, 0.05]
"""
FAMILY = """from scengen.tasks.domino_single import DominoSingle


class Mine(DominoSingle):
    VERSION = 1

    {code}
"""
MEAN = (
    "means = lambda self: {'it falls': __import__('scengen.means', fromlist=['once'])"
    ".once(lambda world: world.touched('slap', 'tile_0'))}"
)
TWICE = "build = lambda self: (s := super(Mine, self).build(), s.worldbody.add_body(name='slab'))[0]"
ABLATED = (
    "ablations = lambda self: {'gone': __import__('scengen.assets.prop', fromlist=['remove'])"
    ".remove(super(Mine, self).build(), 'slap')}"
)
NEEDED = "failure = lambda self, world: str(world.pos('tile_1')) * 0 or None"
"""An ablation takes the second tile out."""


@pytest.fixture
def written(tmp_path, monkeypatch):
    """A function that writes a package whose family has a method of its own, and returns the settings that name it."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))

    def write(module, code):
        (tmp_path / "conf" / "task").mkdir(parents=True)
        (tmp_path / f"{module}.py").write_text(FAMILY.format(code=code))
        (tmp_path / "conf" / "task" / f"{module}.yaml").write_text(TASK.format(module=module))
        return [f"task={module}", f"hydra.searchpath=[file://{tmp_path / 'conf'}]"]

    return write


@pytest.mark.parametrize(
    ("module", "code", "told"),
    [
        ("joint", "success = lambda self, world: world.data.joint('nope').qpos[0] > 0", "in <lambda>: KeyError: "),
        ("body", "failure = lambda self, world: str(world.pos('slap'))", "in <lambda>: no body named 'slap' (did you"),
        ("mean", MEAN, "in <lambda>: no body named 'slap' (did you mean 'slab'?); known: slab, table, tile_0"),
        ("attribute", "constraints = lambda self: iter([self.tlie.mass])", "in <lambda>: AttributeError: "),
        ("nothing", "oracle = lambda self, world: 1 / 0", "in <lambda>: ZeroDivisionError: division by zero"),
    ],
)
def test_an_error_of_a_family_names_its_file_and_line(written, capsys, module, code, told):
    assert cli.run(["try", *written(module, code)]) == 2
    shown = capsys.readouterr().err
    assert f"scengen: {module}.py, line 7, {told}" in shown and "please report" not in shown
    foreseen = module in ("body", "mean")
    assert ("is not scengen's code" in shown) != foreseen, "an error that scengen foresees is one sentence"


@pytest.mark.parametrize(
    ("module", "code", "told"),
    [
        ("twice", TWICE, "repeated name 'slab' in body; give each its own name"),
        ("ablated", ABLATED, "no body named 'slap' (did you mean 'slab'?); known: "),
        ("nothing_returned", "success = lambda self, world: None", "it returned None; return True or False"),
        ("flag", "failure = lambda self, world: world.time > 0.5", "it returned True; return the reason as text, or"),
        ("needed", NEEDED, "(in the ablation no_chain, where it may be missing)"),
    ],
)
def test_a_wrong_name_in_a_scene_ends_the_first_draw(written, tmp_path, capsys, module, code, told):
    assert cli.run(["generate", *written(module, code), "n=1", f"pool={tmp_path / 'pool'}"]) == 2
    shown = capsys.readouterr().err
    assert f"scengen: {module}.py, line 7, in <lambda>: " in shown and told in shown


@pytest.mark.parametrize(
    ("module", "code", "told"),
    [
        ("syntax", "def (", "SyntaxError: invalid syntax (syntax.py, line 7), syntax.py, line 7)"),
        ("absent", "import scengen.nowhere", "No module named 'scengen.nowhere', absent.py, line 7, in Mine)"),
    ],
)
def test_a_family_that_cannot_be_imported_names_its_file_and_line(written, capsys, module, code, told):
    assert cli.run(["tasks", *written(module, code)]) == 2
    assert told in capsys.readouterr().err


def test_the_fault_of_a_policy_has_its_line(tmp_path, monkeypatch, capsys):
    monkeypatch.syspath_prepend(str(tmp_path))
    (tmp_path / "faulty_policy.py").write_text("def mine(*_, **__):\n    return {}['x']\n")
    assert (
        cli.run(
            [
                "evaluate",
                "policy=faulty_policy:mine",
                "pool=generated/reference/domino_single-id",
                f"to={tmp_path / 'to'}",
            ]
        )
        == 2
    )
    assert "faulty_policy.py, line 2, in mine); the fault is the policy's" in capsys.readouterr().err


def _raised(path, error):
    """An error that code in a file of its own has raised."""
    path.write_text("def fail(error):\n    raise error\n")
    space = {"__name__": "somewhere"}
    exec(compile(path.read_text(), str(path), "exec"), space)
    try:
        space["fail"](error)
    except Exception as raised:
        return raised


@pytest.mark.parametrize("error", [KeyError("x"), UnknownName("body", "x", ["y"])])
def test_the_place_survives_the_way_from_a_worker(tmp_path, error):
    _, arrived = pickle.loads(portable(_raised(tmp_path / "theirs.py", error)))
    assert place_of(arrived) == f"{tmp_path / 'theirs.py'}, line 2, in fail" and arrived.__traceback__ is None


def test_scengens_own_errors_are_to_be_reported(monkeypatch, capsys):
    monkeypatch.setattr(tasks, "about", len)  # a fault of a command: two arguments
    assert cli.run(["tasks"]) == 2
    assert "please report it" in capsys.readouterr().err
