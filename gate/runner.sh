# Functions for the other scripts. GitHub's runner interprets commands (`::error::...`, `##[error]...`) in standard output, and reads
# outputs line by line.

# Print a secret word.
secret() {
    echo "end-$RANDOM-$RANDOM-$RANDOM-$RANDOM"
}

# Print standard input without interpreting commands in it.
quoted() {
    local token
    token="$(secret)"
    echo "::stop-commands::$token"
    cat
    echo
    echo "::$token::"
}

# Write the output NAME of the step: the other arguments, one per line. Arguments with control characters are omitted, because thingc
# rejects such documents.
output() {
    local mark name="$1" word
    mark="$(secret)"
    shift
    {
        echo "$name<<$mark"
        for word in "$@"; do
            if [[ "$word" != *[[:cntrl:]]* ]]; then
                printf '%s\n' "$word"
            fi
        done
        echo "$mark"
    } >> "$GITHUB_OUTPUT"
}
