#!/bin/sh
# Rendering without a screen needs one OpenGL library: EGL with Mesa's software renderer, or OSMesa.
PATH="$PATH:/usr/sbin:/sbin" # ldconfig is there
packages="libegl1 libgl1-mesa-dri libopengl0"
if ldconfig -p | grep -q 'libEGL\.so\.1' && ldconfig -p | grep -q 'libOpenGL\.so\.0'; then
    exit 0
fi
if ldconfig -p | grep -q 'libOSMesa\.so'; then
    exit 0
fi
if [ "$(id -u)" = 0 ]; then
    as_root=""
elif command -v sudo >/dev/null && sudo -n true 2>/dev/null; then
    as_root="sudo"
else
    echo "An OpenGL library is missing. As root: apt-get install $packages" >&2
    exit 1
fi
echo "installing $packages"
$as_root apt-get update -qq && $as_root apt-get install -y -qq $packages
