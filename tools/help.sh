#!/bin/sh
# Lists a Makefile's targets with the `##` comment above or beside each.
# Colours only on a terminal, and not where NO_COLOR is set (no-color.org).
set -eu
bold='' plain=''
if [ -t 1 ] && [ -z "${NO_COLOR:-}" ] && [ "${TERM:-dumb}" != dumb ]; then
    bold=$(printf '\033[1;36m') plain=$(printf '\033[0m')
fi
printf 'Usage: make [TARGET] [NAME=VALUE]; without a target: all\n\n'
awk -v bold="$bold" -v plain="$plain" '
    /^## /  { above = substr($0, 4); next }
    /^\.PHONY/ { next }                      # stands between the comment and its target
    /^[A-Za-z0-9_-]+:([^=]|$)/ {
        name = $0; sub(/:.*/, "", name)
        text = above
        if (match($0, /## .*/)) text = substr($0, RSTART + 3)
        if (text != "") printf "  %s%-16s%s %s\n", bold, name, plain, text
    }
    { above = "" }
' "$1"
