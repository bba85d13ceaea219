#!/bin/sh
# What a user does first, in the environment ./env alone: versions, a package of his own, a scenario of it, certified and verified.
set -eu
unset PYTHONPATH
PATH="$PWD/env/bin:$PATH"
pip check
scengen --version
scengen new task=slide_home package=lab_tasks
pip install --quiet --disable-pip-version-check --no-deps --editable lab_tasks
scengen tasks task=slide_home
scengen generate task=slide_home split=far n=1 pool=pool
scengen verify pool=pool
