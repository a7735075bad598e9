#!/bin/sh
# What `make install` runs in the project's folder: deploy/install.sh VENV DESTDIR PREFIX. VENV was made by the
# interpreter that the installed programs run under; its pip is used, nothing of it is installed.
# The packages get a folder of their own below PREFIX/lib, made beside the one of before, whose place it then takes.
set -eu
venv=$1 root=$2 prefix=$3
python=$("$venv/bin/python" -c 'import sys; print("%s/bin/python%d.%d" % (sys.base_prefix, *sys.version_info[:2]))')
lib=$prefix/lib/gestured
share=$root$prefix/share
doc=$share/doc/gestured
new=$root$lib.new old=$root$lib.old
work=$(mktemp -d)
trap 'rm -rf "$work" "$new"' EXIT

put() {  # put MODE FILE FOLDER/NAME: programs and sockets are where PREFIX says
    mkdir -p "$(dirname "$3")"
    sed "s|/usr/bin/gesture|$prefix/bin/gesture|g; s|/usr/share/doc|$prefix/share/doc|g" "$2" >"$3.new"
    chmod "$1" "$3.new"
    mv "$3.new" "$3"
}

keep() {  # keep FILE PATH: an operator's file stays as it is
    [ -e "$2" ] || put 644 "$1" "$2"
}

# The build leaves files beside its sources, so it gets a copy.
mkdir "$work/source"
cp -R pyproject.toml README.md LICENSE NOTICE gestured models "$work/source"
rm -rf "$new" "$old"
mkdir -p "$(dirname "$new")"
"$venv/bin/pip" install --no-compile --target "$new" "$work/source" >"$venv/pip.log" 2>&1 </dev/null || {
    echo "pip could not install gestured: $(grep -i error "$venv/pip.log" | tail -n 1) (all of it: $venv/pip.log)" >&2
    exit 1
}
rm -rf "$new/bin"
find "$new" -name __pycache__ -type d -prune -exec rm -rf {} +
"$python" -m compileall -q -j 0 -s "$new" -p "$lib" "$new"
PYTHONPATH=$new PYTHONDONTWRITEBYTECODE=1 "$python" -m deploy.generate install "$share"
if [ -e "$root$lib" ]; then mv "$root$lib" "$old"; fi
mv "$new" "$root$lib"
rm -rf "$old"

mkdir -p "$root$prefix/bin"
for program in gestured:daemon gesturectl:control; do
    name=${program%:*}
    # No site, no user's folder, no PYTHON* variables; the stack on standard error when a signal kills it.
    cat >"$work/$name" <<END
#!$python -ISXfaulthandler
import sys

sys.path.insert(0, "$lib")
from gestured.${program#*:}.cli import main

sys.exit(main())
END
    put 755 "$work/$name" "$root$prefix/bin/$name"
done

for unit in systemd/*.service systemd/*.socket; do
    put 644 "$unit" "$root$prefix/lib/systemd/system/$(basename "$unit")"
done
put 644 systemd/gestured.sysusers.conf "$root$prefix/lib/sysusers.d/gestured.conf"
put 644 systemd/gestured.tmpfiles.conf "$root$prefix/lib/tmpfiles.d/gestured.conf"
for file in systemd/osc-output.conf deploy/gestured.toml LICENSE NOTICE; do
    put 644 "$file" "$doc/$(basename "$file")"
done
keep deploy/gestured.toml "$root/etc/gestured/gestured.toml"
keep systemd/gestured.default "$root/etc/default/gestured"
