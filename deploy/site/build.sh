#!/bin/sh
# What `make site` runs in the project's folder: deploy/site/build.sh PYTHON OUT. The documents stay where they are: the
# site's source is a folder of links to them, so that their own links are right in it.
set -eu
mkdir -p "$2"
out=$(realpath "$2")
rm -rf "$out/source" "$out/html"
mkdir -p "$out/source/deploy"
ln -s "$PWD"/*.md "$PWD/NOTICE" "$PWD/docs" "$out/source"
ln -s "$PWD/deploy/gestured.toml" "$out/source/deploy"
export SITE_SOURCE="$out/source" NO_MKDOCS_2_WARNING=1
"$1" -m mkdocs build --quiet --strict --config-file deploy/site/mkdocs.yml --site-dir "$out/html"
echo "$2/html/index.html; to search it, too: python3 -m http.server --bind 127.0.0.1 --directory $2/html"
