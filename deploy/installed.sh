#!/bin/sh
# What `make install` says in the end: deploy/installed.sh DESTDIR PREFIX. What went where, and what comes next.
set -eu
root=$1 prefix=$2
put=$root$prefix/lib/gestured/installed

folders() {  # folders PATTERN: those of the installed files that match, once each; no comma, which ends it for sed
    sed -n "s,^\(.*\($1\).*\)/[^/]*\$,\1,p" "$put" | sort -u | paste -s -d ' '
}

echo "installed${root:+ below $root}:"
echo "  programs        $(grep '/bin/' "$put" | paste -s -d ' ')"
echo "  packages        $prefix/lib/gestured"
echo "  systemd units   $(folders '/systemd/system')"
echo "  man pages       $(folders '/man/')"
echo "  completions     $(folders '-completion/\|/vendor[-_]completions')"
echo "  C headers       $(folders '/include/')"
echo "  documents       $(folders '/doc/')"
echo "  settings        /etc/gestured/gestured.toml (yours: it stays as it is)"
if [ -n "$root" ]; then
    echo "next, once it is in its place:"
else
    echo "next:"
fi
echo "  sudo systemd-sysusers && sudo systemd-tmpfiles --create gestured.conf && sudo systemctl daemon-reload"
echo "  sudo systemctl enable --now gestured.service"
