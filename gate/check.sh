#!/usr/bin/env bash
# Checks the documents of the file LIST (names ended by NUL), with remarks at their lines. CODE is `yes` where part code may run.
set -euo pipefail

mapfile -d '' -t documents < "$LIST"
if (( ${#documents[@]} == 0 )); then
    echo "the change concerns no document"
    exit 0
fi
options=()
if [[ "$CODE" != yes ]]; then
    options+=(--no-code)
fi
thingc check --format github "${options[@]}" -- "${documents[@]}"
