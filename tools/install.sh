#!/bin/sh
# Installs scengen for development. Python 3.11 and 3.12 get the exact versions of constraints.txt, with robosuite and its requirements;
# newer ones, for which these have no wheels, the newest versions, and robosuite alone, from which the robot is read.
set -eu
python=$1
pip="$python -m pip install --quiet --disable-pip-version-check"
if "$python" -c 'import sys; sys.exit(sys.version_info[:2] not in [(3, 11), (3, 12)])'; then
    $pip --no-deps -r constraints.txt
    $pip --no-deps --editable .
else
    echo "robosuite's environments are left out: their requirements have wheels for Python 3.11 and 3.12 only (make PYTHON=...)" >&2
    $pip --editable '.[dev]'
    $pip --no-deps "$(grep '^robosuite==' constraints.txt)"
fi
