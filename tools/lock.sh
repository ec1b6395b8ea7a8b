#!/bin/sh
# Writes constraints.txt anew from pyproject.toml: every package, its version for each supported
# Python and system, its hashes, and no address. uv resolves for all of them at once, which pip
# cannot; it runs from a temporary environment, because nothing else in the project needs it.
#
# The pins that are there stay unless pyproject.toml forbids it; UPGRADE=1 moves them forward.
set -eu
cd -- "$(dirname -- "$0")/.."

temporary=$(mktemp -d)
trap 'rm -rf "$temporary"' EXIT
trap 'exit 130' INT TERM HUP

"${PYTHON:-python3}" -m venv "$temporary/venv"
echo "Fetching uv into a temporary environment"
"$temporary/venv/bin/python" -m pip --disable-pip-version-check install --quiet uv

# Into a copy: a resolution that fails must leave constraints.txt as it is.
if [ -z "${UPGRADE:-}" ] && [ -f constraints.txt ]; then cp constraints.txt "$temporary/constraints.txt"; fi
"$temporary/venv/bin/uv" pip compile pyproject.toml --extra dev --python-version 3.11 \
    --universal --generate-hashes --no-header --no-emit-index-url --no-annotate --quiet \
    --output-file "$temporary/constraints.txt"
if cmp -s "$temporary/constraints.txt" constraints.txt; then
    echo "constraints.txt is up to date"
else
    cat "$temporary/constraints.txt" >constraints.txt
    echo "constraints.txt has changed; the next make brings .venv up to date"
fi
