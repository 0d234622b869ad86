#!/usr/bin/env bash
# Check the documents and robot files listed in the files LIST and ROBOT_FILES (terminated by NUL), and annotate their lines. CODE is `yes` if part code may run.
set -euo pipefail

mapfile -d '' -t documents < <(cat "$LIST" "$ROBOT_FILES")
if (( ${#documents[@]} == 0 )); then
    echo "the change affects no document"
    exit 0
fi
options=()
if [[ "$CODE" != yes ]]; then
    options+=(--no-code)
fi
thingc check --format github "${options[@]}" -- "${documents[@]}"
