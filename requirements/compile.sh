#!/bin/sh
# Pins of every group of packages in pyproject.toml, with all that they need and their hashes: make requirements. Pins
# that are there stay where they can, but for `make requirements UPGRADE=--upgrade`.
set -e
compile() {
    name=$1
    shift
    uv pip compile --quiet --universal --python-version 3.11 --generate-hashes --no-annotate --no-emit-index-url \
        --custom-compile-command "make requirements" $upgrade "$@" --output-file "requirements/$name.txt"
}
upgrade=$1
# Left out: what only the build of data files needs, and an old codec that has to be compiled.
compile test pyproject.toml --all-extras --group test \
    --no-emit-package cmeel --no-emit-package jrl-cmakemodules --no-emit-package cbor
compile demo pyproject.toml --group demo --constraint requirements/test.txt
for group in uv bench wheels; do
    compile $group --group $group --constraint requirements/test.txt
done
