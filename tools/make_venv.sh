#!/bin/sh
# Makes .venv, the project's private Python environment, or finds that it is up to date.
#
# Up to date means: .venv/.complete carries the hash of constraints.txt and pyproject.toml.
# That file is deleted before anything in .venv is touched and written after everything is in,
# so a build that was interrupted is never taken for a finished one: it starts from nothing.
# A finished .venv whose pins have changed is brought up to date in place.
#
# PYTHON names the interpreter; without it the first one >= 3.11 in PATH is taken.
set -eu

tools=$(CDPATH='' cd -- "$(dirname -- "$0")" && pwd -P)
root=$(dirname -- "$tools")
cd -- "$root"
venv=.venv
stamp=$venv/.complete
log=build/setup.log
PYTHON=${PYTHON:-}
pip_process=''

say() { printf '%s\n' "$*"; }
fail() {
    printf 'error: %s\n' "$*" >&2
    exit 1
}

# A background command ignores the terminal's Ctrl-C, so it is handed on.
interrupted() {
    trap '' INT TERM HUP
    if [ -n "$pip_process" ]; then
        kill "$pip_process" 2>/dev/null || :
        wait "$pip_process" 2>/dev/null || :
    fi
    printf '\nInterrupted: .venv is unfinished; the next make starts it again.\n' >&2
    exit 130
}
trap interrupted INT TERM HUP

is_new_enough() {
    command -v "$1" >/dev/null 2>&1 &&
        "$1" -c 'import sys; sys.exit(sys.version_info < (3, 11))' >/dev/null 2>&1
}

# Prints the interpreter to build with. Where a venv is active, python3 is a link inside it,
# and rebuilding that venv would delete it: the one behind it is asked for.
base_of() {
    "$1" -c 'import sys; print(getattr(sys, "_base_executable", "") or sys.executable)'
}
short_version_of() {
    "$1" -c 'import sys; print("%d.%d" % sys.version_info[:2])'
}

find_python() {
    for candidate in ${PYTHON:-python3 python3.14 python3.13 python3.12 python3.11}; do
        if is_new_enough "$candidate"; then
            base_of "$candidate"
            return
        fi
    done
    named=${PYTHON:-python3}
    if found=$("$named" --version 2>&1); then
        fail "Python 3.11 or newer is needed, and $named is $found." \
            "Debian 12 and later have it as python3; elsewhere name one: make PYTHON=/path/to/python3.12"
    fi
    fail "no Python: the command '$named' does not run." \
        "Name an installed Python 3.11 or newer: make PYTHON=/path/to/python3.12"
}

# Two makes in two terminals must not build the same .venv at once. The descriptor is inherited
# by pip, so even if this script is killed, the next one waits until pip is really gone.
if command -v flock >/dev/null 2>&1; then
    exec 9<constraints.txt
    flock -n 9 || {
        say "Another make is setting up .venv: waiting for it."
        flock 9
    }
fi

# The path counts because a venv holds absolute paths: one that was moved must be built again.
key=$(cat constraints.txt pyproject.toml | sha256sum | cut -d ' ' -f 1)
usable=no
if [ -f "$stamp" ] && [ -x "$venv/bin/python" ]; then
    { read -r built_key && read -r built_version && read -r built_root; } <"$stamp" || built_root=''
    if [ "$built_root" = "$root" ]; then
        usable=yes
        # Only an interpreter that was asked for by name replaces the one in use.
        if [ -n "$PYTHON" ]; then
            is_new_enough "$PYTHON" && [ "$(short_version_of "$PYTHON")" = "$built_version" ] || usable=no
        fi
        [ "$usable" = no ] || [ "$built_key" != "$key" ] || exit 0
    fi
fi

if [ -z "$PYTHON" ] && ! command -v python3 >/dev/null 2>&1; then
    echo 'python python3 python3 runs the generator, the plant and the proofs' |
        "$tools/system_tools.sh" -t - python
fi
python=$(find_python)

mkdir -p build
rm -f "$stamp"
if [ "$usable" = yes ]; then
    say "Updating .venv: constraints.txt or pyproject.toml has changed (log: $log)"
else
    say "Making .venv with $python: the Python packages of constraints.txt at their exact versions,"
    say "each checked against its hash; about 2.7 GB, one to two minutes (log: $log)"
    if ! "$python" -c 'import ensurepip' >/dev/null 2>&1; then
        # Debian keeps this part of the standard library in a package of its own.
        case $python in
            /usr/bin/*) ;;
            *) fail "$python has no ensurepip, which makes pip for .venv: name a complete Python," \
                "for example make PYTHON=/usr/bin/python3" ;;
        esac
        package=python$(short_version_of "$python")-venv
        echo "python ensurepip@$python $package makes private Python environments such as .venv" |
            "$tools/system_tools.sh" -t - python
    fi
    rm -rf "$venv"
    "$python" -m venv "$venv"
fi

count_installed() { find "$venv"/lib/python3*/site-packages -maxdepth 1 -name '*.dist-info' | wc -l; }

# Runs pip with its output in the log and tells how far it is: on a terminal in one line that
# changes, elsewhere now and then.
pip_install() {
    printf '\n$ pip install %s\n' "$*" >>"$log"
    "$venv/bin/python" -m pip --disable-pip-version-check --no-input install --no-color \
        --progress-bar off "$@" >>"$log" 2>&1 </dev/null &
    pip_process=$!
    before=$(count_installed)
    seconds=0
    while kill -0 "$pip_process" 2>/dev/null; do
        total=$(sed -n 's/^Installing collected packages: //p' "$log" | tail -n 1 | tr ',' '\n' | grep -c . || :)
        if [ "$total" -gt 0 ]; then
            progress="installing: $(($(count_installed) - before)) of $total"
        else
            progress="fetching: $(grep -c '^Collecting ' "$log" || :) packages so far"
        fi
        if [ -t 1 ]; then
            printf '\r  %3d s  %-40s' "$seconds" "$progress"
        elif [ $((seconds % 15)) -eq 5 ]; then
            printf '  %3d s  %s\n' "$seconds" "$progress"
        fi
        sleep 1
        seconds=$((seconds + 1))
    done
    if [ -t 1 ]; then printf '\r%60s\r' ''; fi
    status=0
    wait "$pip_process" || status=$?
    pip_process=''
    if [ "$status" -ne 0 ]; then
        tail -n 15 "$log" >&2
        fail "pip could not install the packages; its last words are above, all of them in $log"
    fi
}

: >"$log"
# Wheels only: without one for this Python and machine, pip would try to compile CasADi for an hour.
pip_install --require-hashes --only-binary :all: -r constraints.txt
pip_install --no-deps --no-build-isolation -e .

printf '%s\n' "$key" "$(short_version_of "$venv/bin/python")" "$root" >"$stamp.new"
mv "$stamp.new" "$stamp"
say "  .venv is ready"
