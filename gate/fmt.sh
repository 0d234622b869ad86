#!/usr/bin/env bash
# Says which documents of the file LIST are not as `thingc fmt` writes them.
set -euo pipefail

mapfile -t documents < "$LIST"
if (( ${#documents[@]} == 0 )); then
    exit 0
fi
if ! thingc fmt --check --diff -- "${documents[@]}"; then
    echo "run: thingc fmt ${documents[*]@Q}"
    exit 1
fi
