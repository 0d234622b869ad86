"""What all readers have in common: requests are read from one file of JSON, answers and the reader's version are written to another."""

from __future__ import annotations

import json


def serve(answer, version, arguments):
    """Answer every request; what a reader cannot take is its own words."""
    with open(arguments[1]) as stream:
        requests = json.load(stream)
    answers = []
    for asked in requests:
        try:
            answers.append(answer(asked))
        except Exception as fault:  # whatever the reader raises is its answer
            answers.append({"cannot": f"{type(fault).__name__}: {fault}"})
    with open(arguments[2], "w") as stream:
        json.dump({"version": version, "answers": answers}, stream)
