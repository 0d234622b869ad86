# For the scripts beside this one: what has to do with GitHub's runner, which reads commands (`::error::...`, `##[error]...`) in all
# that is printed, and outputs by line.

# A word that nobody else knows.
secret() {
    echo "end-$RANDOM-$RANDOM-$RANDOM-$RANDOM"
}

# Prints standard input; nothing in it is taken for a command.
quoted() {
    local token
    token="$(secret)"
    echo "::stop-commands::$token"
    cat
    echo
    echo "::$token::"
}

# An output of the step, NAME, of the other words: one on a line. Those that hold a line end are left out; thingc refuses such documents.
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
