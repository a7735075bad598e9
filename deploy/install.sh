#!/bin/sh
# What `make install` runs in the project's folder: deploy/install.sh VENV DESTDIR PREFIX. VENV was made by the
# interpreter that the installed programs run under; it is used to build, and nothing of it is installed.
# The packages get a folder of their own below PREFIX/lib, made beside the one of before, whose place it then takes.
# For a Debian package deploy/deb.sh has put all that VENV lacks into the folder WHEELS, and nothing is asked of an index.
set -eu
umask 022
venv=$1 root=$2 prefix=$3
python=$("$venv/bin/python" -c 'import sys; print("%s/bin/python%d.%d" % (sys.base_prefix, *sys.version_info[:2]))')
lib=$prefix/lib/gestured
share=$prefix/share
doc=$share/doc/gestured
units=$prefix/lib/systemd/system
new=$root$lib.new old=$root$lib.old

if [ -z "$root" ] && dpkg-query --show --showformat='${db:Status-Status}' gestured 2>/dev/null | grep -q '^installed$'; then
    echo "gestured is installed as a Debian package: sudo apt remove gestured (settings and own gestures stay) first" >&2
    exit 1
fi
work=$(mktemp -d)
trap 'rm -rf "$work" "$new"' EXIT
trap 'exit 130' HUP INT TERM  # dash would leave out the line above

put() {  # put MODE FILE PATH: programs and pages are where PREFIX says
    mkdir -p "$root$(dirname "$3")"
    sed "s,/usr/\(bin/gesture\|include\|lib/gestured\|share/doc\),$prefix/\1,g" "$2" >"$root$3.new"
    chmod "$1" "$root$3.new"
    mv "$root$3.new" "$root$3"
    echo "$3" >>"$work/installed"
}

page() {  # page FILE: a document, whose neighbours all stand in one folder
    sed 's,](\.\./,](,g; s,](docs/,](,g; s,](deploy/,](,g' "$1" >"$work/page"
    put 644 "$work/page" "$doc/$(basename "$1")"
}

keep() {  # keep FILE PATH: an operator's file stays as it is, here and by `make uninstall`
    [ -e "$root$2" ] || install -D -m 644 "$1" "$root$2"
}

pip() {  # pip ARGUMENT...: install with the pip of VENV
    "$venv/bin/pip" install "$@" >"$venv/pip.log" 2>&1 </dev/null || {
        echo "pip could not install $*: $(grep -i error "$venv/pip.log" | tail -n 1) (all of it: $venv/pip.log)" >&2
        exit 1
    }
}

touch "$work/before"
if [ -e "$root$lib/installed" ]; then cp "$root$lib/installed" "$work/before"; fi
rm -rf "$new" "$old"
mkdir -p "$new"  # a folder that may not be made is told now, and not after minutes of pip
if [ -n "${WHEELS-}" ]; then
    # shellcheck disable=SC2086 # words on purpose
    pip --no-compile --target "$new" --no-index --no-deps --only-binary :all: $PLATFORM "$WHEELS"/*.whl
    pip --no-compile --target "$new" --no-index --no-deps --no-build-isolation .
else
    pip shtab  # makes the completions
    pip --no-compile --target "$new" ".[mqtt,zenoh,serial]"
fi
rm -rf "${new:?}/bin"
find "$new" -name __pycache__ -type d -prune -exec rm -rf {} +
"$python" -m compileall -q -j 0 ${WHEELS:+--invalidation-mode unchecked-hash} -s "$new" -p "$lib" "$new"
PYTHONPATH=${WHEELS:-$new} PYTHONDONTWRITEBYTECODE=1 PYTHON_COLORS=0 "$venv/bin/python" -m deploy.generate install "$work/share"
if [ -e "$root$lib" ]; then mv "$root$lib" "$old"; fi
mv "$new" "$root$lib"
rm -rf "$old"

for program in gestured:daemon gesturectl:control gestured-bridge:bridge; do
    name=${program%:*}
    # No site, no user's folder, no PYTHON* variables: it runs with what was installed with it.
    cat >"$work/$name" <<END
#!$python -IS
import sys

sys.path.insert(0, "$lib")
from gestured.${program#*:}.cli import main

sys.exit(main())
END
    put 755 "$work/$name" "$prefix/bin/$name"
done
for unit in systemd/*.service systemd/*.socket; do
    put 644 "$unit" "$units/$(basename "$unit")"
done
put 644 systemd/gestured.sysusers.conf "$prefix/lib/sysusers.d/gestured.conf"
put 644 systemd/gestured.tmpfiles.conf "$prefix/lib/tmpfiles.d/gestured.conf"
(cd "$work/share" && find . -type f) | while read -r file; do
    put 644 "$work/share/$file" "$share/${file#./}"
done
for header in deploy/c/*.h; do
    put 644 "$header" "$prefix/include/$(basename "$header")"
done
for file in systemd/osc-output.conf deploy/gestured.toml deploy/prometheus/gestured.rules.yml \
    deploy/prometheus/prometheus.yml deploy/grafana/dashboards/gestured.json docs/*.json docs/*.svg LICENSE NOTICE; do
    put 644 "$file" "$doc/$(basename "$file")"
done
for file in *.md docs/*.md; do
    page "$file"
done
keep deploy/gestured.toml /etc/gestured/gestured.toml
keep systemd/gestured.default /etc/default/gestured
grep -vxFf "$work/installed" "$work/before" | while read -r file; do
    rm -f "$root$file"  # of an older version, which this one has no more
done
mv "$work/installed" "$root$lib/installed"  # what `make uninstall` removes, beside the packages
cat <<END
installed${root:+ below $root}:
  programs    $prefix/bin/gestured, gesturectl and gestured-bridge
  packages    $lib
  the rest    units, man pages, completions, C headers, documents: $lib/installed names each file
  settings    /etc/gestured/gestured.toml and /etc/default/gestured (yours: they stay as they are)
next${root:+, once it is in its place}:
  sudo systemd-sysusers && sudo systemd-tmpfiles --create gestured.conf && sudo systemctl daemon-reload
  sudo systemctl enable --now gestured.service
END
