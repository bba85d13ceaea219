#!/bin/sh
# Pictures need OpenGL without a display. Install it where that is allowed; otherwise say what is missing and go on.
if ldconfig -p 2>/dev/null | grep -q 'libEGL\.so\|libOSMesa\.so'; then
    exit 0
fi
packages="libegl1 libgl1 libosmesa6"
if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null 2>&1; then
    (apt-get update && apt-get install -y --no-install-recommends $packages) >/dev/null 2>&1 && exit 0
fi
echo "no OpenGL for pictures: install $packages (Debian names); everything else works without"
