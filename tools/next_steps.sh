#!/bin/sh
# The last words of `make`: what there is to look at now.
set -eu
printf '\nDone. Look at:\n'
printf '  %-28s %s\n' \
    build/report/index.html 'the report: open it in a browser' \
    'generated/' 'the C to copy into your firmware' \
    'controllers/' 'the specifications to change' \
    'docs/quick-start.md' 'ten minutes to gains of your own' \
    'make playground' 'the same C in a page with sliders' \
    'make help' 'everything else'
