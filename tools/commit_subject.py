"""Check the subject of a commit message: imperative, at most 72 characters: `python tools/commit_subject.py FILE`."""

import re
import sys
from pathlib import Path

MAX_LENGTH = 72
"""Largest length of a subject [characters], which git log and GitHub show in full."""
NOT_IMPERATIVE = re.compile(r"[A-Z]\w*(?:ed|ing|[^su]s)|The|An?|It|This|These|There|We|I")
"""First words that are no verb in the imperative: past forms, participles, third persons, articles, pronouns."""
IMPERATIVE = frozenset(
    {"Alias", "Bring", "Canvas", "Embed", "Exceed", "Feed", "Proceed", "Seed", "Speed", "Spring", "String"}
)
"""Imperatives that look like other forms."""


def faults(message: str) -> list[str]:
    """Faults of the first line of a commit message; none for merges and reverts, whose subjects git writes."""
    subject = message.split("\n", 1)[0]
    if subject.startswith(("Merge ", "Revert ", "fixup! ", "squash! ")):
        return []
    found, first = [], re.split(r"\W", subject, maxsplit=1)[0]
    if len(subject) > MAX_LENGTH:
        found.append(f"it has {len(subject)} characters; use at most {MAX_LENGTH}")
    if not first[:1].isupper():
        found.append("it must start with a capital letter")
    if NOT_IMPERATIVE.fullmatch(first) and first not in IMPERATIVE:
        found.append(f"it starts with {first!r}; start with a verb in the imperative, such as Add or Fix")
    if subject.endswith("."):
        found.append("it must not end with a full stop")
    return found


def main() -> int:
    """Print the faults of the message in a file. Returns the exit status."""
    found = faults(Path(sys.argv[1]).read_text())
    for fault in found:
        print(f"commit subject: {fault}", file=sys.stderr)
    return bool(found)


if __name__ == "__main__":
    sys.exit(main())
