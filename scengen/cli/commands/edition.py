"""check or write a frozen set of evaluation scenarios, which is the same in all laboratories"""

from dataclasses import dataclass

from ...errors import UnknownName
from ...evaluate.edition import Edition, chosen_sets, differences, make_pool, path_of
from ...runs.progress import ProgressBar
from ...work.limits import at_least
from ...work.parallel import Workers
from ...work.targets import try_file
from . import FAILED, OK, Arguments, err, remark, say, warn
from .settings import read


@dataclass(frozen=True)
class EditionSettings:
    """Settings of `scengen edition`; conf/command/edition.yaml explains them."""

    edition: str = "v1"
    tasks: str | list[str] | None = None
    write: bool = False
    workers: Workers = 1


def command(arguments: Arguments) -> int:
    settings = read("edition", arguments, EditionSettings)
    at_least(settings, workers=1)
    path = path_of(settings.edition)
    if settings.write:
        try_file(str(path))
    edition = Edition.new(path) if settings.write and not path.exists() else Edition.read(settings.edition)
    keys = chosen_sets(settings.tasks)
    for line in edition.other_versions(keys):
        remark(line)
    found = _differences(edition, [key for key in keys if key in edition.sets])
    missing = [key for key in keys if key not in edition.sets]
    for key in missing if settings.write else ():
        edition = _extended(edition, key, settings.workers)
    if missing and not settings.write:
        say(f"{len(missing)} sets are missing: {', '.join(missing)}; scengen edition write=true makes them")
    for line in found:
        warn(line)
    if found:
        say(f"{len(found)} scenarios of {path} are others here: this version needs another edition")
        return FAILED
    same = f"{sum(key in edition.sets for key in keys)} of {len(keys)} sets of {edition.n} scenarios"
    say(f"edition {edition.name}: {same}, which this version draws in the same way; sha256 {edition.sha256}")
    return OK


def _differences(edition: Edition, keys: list[str]) -> list[str]:
    """Differences between the draws of this version and some sets."""
    found = []
    with ProgressBar(err, f"check edition {edition.name}", len(keys)) as progress_bar:
        for done, key in enumerate(keys, 1):
            try:
                found += differences(edition, key)
            except UnknownName as error:  # a task or axis of the edition is gone
                found.append(f"{key}: {error}")
            progress_bar.of(done, len(keys), key)
    return found


def _extended(edition: Edition, key: str, workers: Workers) -> Edition:
    """The edition with one more set, which is in its file when this returns."""
    with ProgressBar(err, f"{edition.name} {key}", edition.n, workers) as progress_bar:
        extended = edition.with_set(key, make_pool(edition, key, workers, progress_bar.of))
    extended.save()
    say(f"{key}: {edition.n} scenarios, in {edition.path}")
    return extended
