#!/usr/bin/env bash
# Check the documents listed in the file LIST (terminated by NUL) and annotate their lines. CODE is `yes` if part code may run.
set -euo pipefail

mapfile -d '' -t documents < "$LIST"
if (( ${#documents[@]} == 0 )); then
    echo "the change affects no document"
    exit 0
fi
options=()
if [[ "$CODE" != yes ]]; then
    options+=(--no-code)
fi
thingc check --format github "${options[@]}" -- "${documents[@]}"
