#!/bin/sh
# Tests of `scengen studio` run in Chromium. Install it where that is allowed; otherwise say that these tests are skipped.
for browser in chromium chromium-browser google-chrome google-chrome-stable chrome; do
    if command -v $browser >/dev/null 2>&1; then
        exit 0
    fi
done
if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null 2>&1; then
    (apt-get update && apt-get install -y --no-install-recommends chromium) >/dev/null 2>&1 && exit 0
fi
echo "no Chromium: the tests of scengen studio in a browser are skipped; install chromium (Debian's name)"
