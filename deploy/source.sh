#!/bin/sh
# deploy/source.sh FOLDER: the project's files as git knows them, and nothing that lies beside them, with the same modes
# whatever the umask is. What is built of them depends on the commit alone.
set -eu
rm -rf "$1"
mkdir -p "$1"
git ls-files -z >/dev/null 2>&1 || { echo "packages are built in a clone, where git says which files belong to it" >&2; exit 1; }
git ls-files -z | tar --create --null --files-from=- --mode=u=rwX,go=rX --owner=0 --group=0 |
    tar --extract --preserve-permissions --no-same-owner --directory="$1"
