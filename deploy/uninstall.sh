#!/bin/sh
# What `make uninstall` runs: deploy/uninstall.sh DESTDIR PREFIX. Removes what `make install` has put there; the
# settings in /etc and the account stay.
set -eu
root=$1 lib=$2/lib/gestured
[ -e "$root$lib/installed" ] || { echo "gestured is not installed in $root$lib" >&2; exit 1; }
while read -r file; do
    rm -f "$root$file"
done <"$root$lib/installed"
rm -rf "$root$lib"
rmdir "$root$2/share/doc/gestured"
