"""Command lines as nobody should write them: a seeded grammar over all commands, their settings and bad values."""

import random
import re
from pathlib import Path

from scengen import cli
from scengen.samplers import task_files

LONG = 10_000
"""Letters of the longest names."""

WORDS = ["", "nope", "id", "diagonal", "wide_gaps@3", "wide_gaps@", "a+b", "id+id", "domino_single", "packing", "quick"]
NUMBERS = ["0", "-1", "1", "2", "3", "2.5", "-0.0", "1e400", "-1e400", "nan", "inf", "1e-300", "1e24", "0x10", "1_000"]
HUGE = ["9" * 20, "9" * 400, "9" * 5000, "1000000000", "4294967296", "-9223372036854775809", "18446744073709551616"]
INTERPOLATIONS = [
    "${nope}",
    "${oc.env:SCENGEN_NO_SUCH}",
    "${oc.env:HOME}",
    "${n}",
    "${a:b:c}",
    "${",
    "${}",
    "${.}",
    "${..x}",
    "${${a}}",
    "${oc.decode:'{'}",
    "${oc.select:x,1}",
    "${hydra:runtime.cwd}",
    "{c:${a.b}}",
    "\\${x}",
    "'${nope}'",
]
NESTED = [
    "[]",
    "[[]]",
    "[a,[b]]",
    "[null]",
    "[1,2,3]",
    "{a:1}",
    "{a:{b:[1,{c:null}]}}",
    "[" * 40 + "]" * 40,
    "[" * 3000,
    "{" * 30 + "}" * 30,
    "[a",
    "a]",
    "{a:1",
    "{:}",
    "(",
    "())",
    "[uniform,1,2]",
    "[choice,1]",
    "{a:1,a:2}",
]
TYPES = [
    "true",
    "false",
    "null",
    "None",
    "~",
    "''",
    '""',
    "' '",
    "'a b'",
    "'a,b'",
    '"[x]"',
    "a b",
    "a:b",
    "a,b",
    ",",
    "=",
]
SWEEPS = [
    "choice(1,2)",
    "range(1,3)",
    "glob(*)",
    "interval(0,1)",
    "1,2,3",
    "shuffle(a,b)",
    "sort(1,2)",
    "int(3)",
    "str([])",
]
TEXTS = [
    "\x1b[31mred",
    "\x1b]0;title\x07",
    "\u202egpj",
    "[/]",
    "[bold]x[/bold]",
    "[red",
    ":smile:",
    "é",
    "\udcff",
    "a\nb",
    "a\rb",
    "\x00",
    "\u2028",
    "😀",
    "%s%n",
    "!!python/object:os.system",
    "$(id)",
    ";id",
    "*",
    "@",
    "#",
    "--",
    "\\",
    "'",
]
IDS = [
    "../../../evil",
    "/any/where",
    "..",
    ".",
    "a",
    "g",
    "<script>",
    "0" * 12,
    "F" * 12,
    "0" * 13,
    "*",
    "%00",
    "a/b",
    "[/]",
]
KEYS = [
    "nope",
    "n.n",
    "n",
    "a.b.c",
    "task",
    "task.id",
    "task.axes",
    "task.family",
    "task.horizon",
    "task.nope",
    "certify",
    "seed",
    "certify.rest.seconds",
    "certify.robust.runs",
    "certify.robust.latency",
    "certify.overlap",
    "certify.nope",
    "hydra",
    "hydra.run.dir",
    "hydra.searchpath",
    "hydra/launcher",
    "a@b",
    "task@x",
    "_target_",
    "",
    " ",
    ".",
    "..",
    "x" * LONG,
    "task/x",
]
PATHS_IN = [
    *("pool", "to", "json", "junit", "mesh", "film", "data", "policy", "client", "model", "prices", "ycb", "records"),
    *("hits", "apart", "attack", "within", "device", "edition", "version", "key"),
]
"""Settings that name files and folders, or could."""
SCHEMES = ["", "", "", "", "transcript:", "file:", "replay:", "ws://", "zmq://", "http://", "pkg://", "module:"]
"""What stands before a path, or nothing."""
PARTS = [
    "certify",
    "executor",
    "task",
    "command",
    "facts",
    "clients",
    "limits",
    "cues",
    "editions",
    "hydra/job_logging",
]
"""Groups of configurations, and folders of conf that are none."""
OPTIONS = [
    "full",
    "quick",
    "nope",
    "domino_single",
    "local",
    "verify",
    "none",
    "",
    "null",
    "quick,full",
    "[quick,full]",
    "../task",
]
"""Options of groups."""
DELETED = [
    *("task", "task.axes", "task.axes.wide_gaps", "task.id", "task.id.gap", "task.horizon", "task.family", "certify"),
    *(
        "certify.robust",
        "certify.robust.runs",
        "certify.rest.seconds",
        "executor",
        "executor.address",
        "defaults",
        "~n",
    ),
    *("n=3", "n=", "budget", "budget.tokens", "certify=quick", "task=domino_single", "hydra", "hydra/launcher", "[n]"),
]
"""What a line deletes."""

NONSENSE = {
    "tiers": ["[]", "[nope]", "[null]", "random", "[random,random]"],
    "units": ["nope", "km", "1"],
    "up": ["w", "-q", "yy", "[x]", "null", "1", "Z"],
    "friction": ["nan", "inf", "-inf", "-1"],
    "license": ['"a\nb"', "' '", "\x1b[2J", "a:b"],
    "title": ['"a\nb"', "' '", "# x"],
    "ycb": ["nowhere", "."],
    "what": ["jitter", "jitter:", "jitter:-1", "jitter:1.5", "jitter:99999", "witness", "Oracle", "oracle,witness"],
    "show film": ["x", "x.gif", ".mp4", "/nowhere/x.mp4", "x.png/"],
    "executor": ["[]", "{}", "null", "[local]", "''"],
    "certify": ["[]", "{}", "null", "''"],
    "hydra.searchpath": [
        "[pkg://nope.nope]",
        "[pkg://nope]",
        "[file:///nowhere]",
        "[file://]",
        "[nope]",
        "nope",
        "[]",
        "[[]]",
        "[null]",
        "[pkg://..]",
        "[pkg://scengen]",
    ],
}
"""Values that look plausible and have no meaning, by setting."""

SETTINGS = {verb: re.findall(r"^(\w+):", task_files.command_file(verb).read_text(), re.M) for verb in cli.VERBS}
"""Settings of every command, from its file."""
WITH_TASK = [verb for verb, names in SETTINGS.items() if "defaults" in names]


class Grammar:
    """Makes command lines from a seed.

    Args:
        pool: a sound pool that commands may read.
        place: a folder with the targets that `targets` names.
    """

    def __init__(self, seed: int, pool: Path, place: Path):
        self.random, self.pool, self.place = random.Random(seed), pool, place

    def line(self) -> list[str]:
        """One command line: mostly plausible, with one to three things wrong."""
        pick = self.random
        if pick.random() < 0.03:
            return [pick.choice([*TEXTS, *TYPES, *IDS, "x" * LONG, "generat", "-v", "--version", "help"])]
        verb = pick.choice(cli.VERBS)
        settings = self._plausible(verb)
        for _ in range(pick.choice((1, 1, 1, 2, 3))):
            self._spoil(verb, settings)
        line = [f"{key}={value}" if value is not None else key for key, value in settings]
        pick.shuffle(line)
        return [*verb.split(), *line]

    def _plausible(self, verb: str) -> list[tuple[str, str | None]]:
        """What a command needs to begin its work."""
        names = SETTINGS[verb]
        found: list[tuple[str, str | None]] = []
        if verb in WITH_TASK and not (verb in ("attack", "try") and self.random.random() < 0.5):
            found.append(("task", "domino_single"))
        if "pool" in names and not (verb == "try" and found):
            made = verb == "generate"
            found.append(("pool", str(self.place / "new" / "pool") if made else str(self.pool)))
        if "to" in names:
            suffix = {"show film": ".png", "report": ".html", "asset": ".stl"}.get(verb, "")
            found.append(("to", str(self.place / "new" / f"target{suffix}")))
        given = {
            "axis card": ("axis", "wide_gaps"),
            "show film": ("id", "0"),
            "show view": ("id", "0"),
            "try": ("index", "1") if found else ("id", "0"),
            "evaluate": ("policy", "idle"),
            "measure": ("kind", "belief"),
            "asset": ("name", "cup"),
            "new": ("package", "lab_tasks"),
            "agent": ("model", "idle"),
            "curate": ("data", str(self.place / "recording")),
            "curate stats": ("data", str(self.place / "recording")),
            "train": ("data", str(self.place / "recording")),
            "export recipe": ("data", str(self.place / "recording")),
        }
        if verb == "new":
            found.append(("task", "slide_home"))
        if verb in given:
            found.append(given[verb])
        return found

    def _spoil(self, verb: str, settings: list[tuple[str, str | None]]) -> None:
        pick, names = self.random, [n for n in SETTINGS[verb] if n != "defaults"] or ["task"]
        kind = pick.choice(
            (
                "value",
                "value",
                "value",
                "nonsense",
                "path",
                "path",
                "key",
                "bare",
                "delete",
                "group",
                "add",
                "id",
                "task",
                "drop",
            )
        )
        key = pick.choice(names)
        if kind == "value":
            settings[:] = [(k, v) for k, v in settings if k != key]
            settings.append((key, self._value()))
        elif kind == "nonsense":
            own = [n for n in NONSENSE if n in names or ("defaults" in SETTINGS[verb] and n not in SETTINGS[verb])]
            key = pick.choice(own or ["hydra.searchpath"])
            settings[:] = [(k, v) for k, v in settings if k != key]
            settings.append((key, pick.choice(NONSENSE[key])))
        elif kind == "path":
            paths = [n for n in names if n in PATHS_IN] or [key]
            key = pick.choice(paths)
            settings[:] = [(k, v) for k, v in settings if k != key]
            several = pick.choice((f"{self._path()},{self._path()}", f"[{self._path()},{self._path()}]"))
            path = several if pick.random() < 0.1 else pick.choice(SCHEMES) + self._path()
            settings.append((key, path))
        elif kind == "key":
            settings.append((pick.choice(("", "", "+", "++", "~")) + pick.choice(KEYS), self._value()))
        elif kind == "bare":
            settings.append((pick.choice([*KEYS, *TEXTS, *NESTED, "--help-me", "-", key]), None))
        elif kind == "delete":
            settings.append((f"~{pick.choice([*KEYS, *names, *DELETED, *DELETED])}", None))
        elif kind == "group":
            package = pick.choice(("", "", "", "@x", "@_global_", "@certify.robust", "@:", "@"))
            key = f"{pick.choice(('', '', '+', '++', '~'))}{pick.choice(PARTS)}{package}"
            settings.append((key, pick.choice(OPTIONS)))
        elif kind == "add":
            settings.append((f"+{key}", self._value()))
        elif kind == "id":
            settings.append((pick.choice(("id", "policy", "axis", "split", "camera", "of")), pick.choice(IDS)))
        elif kind == "task":
            settings.append(
                (
                    pick.choice(
                        (
                            "task.id.tile.mass",
                            "task.axes.x",
                            "task.horizon",
                            "+task.id.gap",
                            "task.family",
                            "task.embodiment",
                            "certify.rest.seconds",
                            "certify.robust.latency",
                        )
                    ),
                    self._value(),
                )
            )
        elif settings:
            settings.pop(pick.randrange(len(settings)))

    def _value(self) -> str:
        kinds = (
            WORDS,
            NUMBERS,
            NUMBERS,
            HUGE,
            INTERPOLATIONS,
            NESTED,
            TYPES,
            SWEEPS,
            TEXTS,
            IDS,
            ["x" * LONG, "x " * LONG],
        )
        return self.random.choice(self.random.choice(kinds))

    def _path(self) -> str:
        place = self.place
        return self.random.choice(
            [
                "/dev/full",
                "/dev/null",
                "/proc/x",
                "/proc/self/mem",
                ".",
                "..",
                "/",
                "",
                "~",
                f"{place}/file",
                f"{place}/file/below",
                f"{place}/folder",
                f"{place}/pipe",
                f"{place}/loop",
                f"{place}/dangling",
                f"{place}/{'n' * 300}",
                "x" * LONG,
                f"{place}/{'d/' * 3000}",
                f"{place}/folder/./../folder",
                f"{place}/new/\x1b[2J",
                f"{place}/new/[bold]",
                f"{place}/é/ü",
                str(self.pool),
                f"{self.pool}/manifest.json",
                f"{self.pool},{self.pool}",
                f"{place}/cut",
                f"{place}/sparse",
                f"{place}/pointer.stl",
                f"{place}/socket",
                f"{place}/recording",
                f"{place}/demonstrations",
                f"{place}/demonstrations/demonstrations.json",
                *(f"{place}/piped/{kind}" for kind in ("pool", "recording", "demonstrations", "policy", "run")),
                *(f"{place}/sparse_{kind}" for kind in ("pool", "recording", "demonstrations", "policy", "run")),
                f"{place}/both",
                "/dev/zero",
                "/dev/stdin",
                "/dev/tty",
                "/proc/self/environ",
                "/proc/self/fd/0",
                f"{place}/wrong.txt",
            ]
        )
