#!/bin/sh
# What the wheel beside ./env holds, and what a user does first, in that environment alone: versions, a package of his own, a scenario of
# it, certified and verified.
set -eu
unset PYTHONPATH
PATH="$PWD/env/bin:$PATH"
size=$(cat scengen-*.whl | wc -c)
if [ "$size" -ge 3000000 ] || python -m zipfile -l scengen-*.whl | grep -E '\.(stl|obj) '; then
    echo "the wheel has $size bytes; it must have less than 3 MB, and no meshes" >&2
    exit 1
fi
pip check
scengen --version
scengen new task=slide_home package=lab_tasks
pip install --quiet --disable-pip-version-check --no-deps --editable lab_tasks
scengen tasks task=slide_home
scengen generate task=slide_home split=far n=1 pool=pool
scengen verify pool=pool
