#!/bin/sh
# Steps of the Makefile: sh tools/setup.sh python PYTHON | opengl | chromium | wheel
set -eu

# Installs packages of Debian where that is allowed.
apt() {
    [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null 2>&1 &&
        (apt-get update && apt-get install -y --no-install-recommends "$@") >/dev/null 2>&1
}

case $1 in
python)
    # Installs scengen for development. Python 3.11 and 3.12 get the exact versions of constraints.txt, with robosuite and its
    # requirements; newer ones, for which these have no wheels, the newest versions, and robosuite alone, from which the robot is read.
    python=$2
    pip="$python -m pip install --quiet --disable-pip-version-check"
    if "$python" -c 'import sys; sys.exit(sys.version_info[:2] not in [(3, 11), (3, 12)])'; then
        $pip --no-deps -r constraints.txt
        $pip --no-deps --editable .
    else
        echo "robosuite's environments are left out: their requirements have wheels for Python 3.11 and 3.12 only (make PYTHON=...)" >&2
        $pip --editable '.[dev]'
        $pip --no-deps "$(grep '^robosuite==' constraints.txt)"
    fi
    ;;
opengl)
    # Pictures need OpenGL without a display. Install it where that is allowed; otherwise say what is missing and go on.
    packages="libegl1 libgl1 libosmesa6"
    if ! ldconfig -p 2>/dev/null | grep -q 'libEGL\.so\|libOSMesa\.so' && ! apt $packages; then
        echo "no OpenGL for pictures: install $packages (Debian names); everything else works without"
    fi
    ;;
chromium)
    # Tests of `scengen studio` run in Chromium. Install it where that is allowed; otherwise say that these tests are skipped.
    for browser in chromium chromium-browser google-chrome google-chrome-stable chrome; do
        if command -v $browser >/dev/null 2>&1; then
            exit 0
        fi
    done
    apt chromium || echo "no Chromium: the tests of scengen studio in a browser are skipped; install chromium (Debian's name)"
    ;;
wheel)
    # What the wheel beside ./env holds, and what a user does first, in that environment alone: versions, a package of his own, a
    # scenario of it, certified and verified.
    unset PYTHONPATH
    PATH="$PWD/env/bin:$PATH"
    size=$(cat scengen-*.whl | wc -c)
    if [ "$size" -ge 10000000 ] || python -m zipfile -l scengen-*.whl | grep -E '\.(stl|obj) '; then
        echo "the wheel has $size bytes; it must have less than 10 MB, 5 of which are the pools of generated/reference, and no meshes" >&2
        exit 1
    fi
    pip check
    scengen --version
    scengen new task=slide_home package=lab_tasks
    pip install --quiet --disable-pip-version-check --no-deps --editable lab_tasks
    scengen tasks task=slide_home
    scengen generate task=slide_home split=far n=1 pool=pool
    scengen verify pool=pool
    ;;
*)
    echo "setup.sh has no step $1; it has python PYTHON, opengl, chromium and wheel" >&2
    exit 2
    ;;
esac
