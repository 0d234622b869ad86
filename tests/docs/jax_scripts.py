"""Run commands of pages whose scripts use JAX, one after the other, as `pages` asks on standard input: a folder and a command in JSON."""

from __future__ import annotations

import json
import os
import shlex
import sys
import traceback

import jax

from docs.pages import run_here

for line in sys.stdin:
    folder, command = json.loads(line)
    os.chdir(folder)
    try:
        printed = run_here(shlex.split(command, comments=True))
    except BaseException:  # a script that fails does not end the others
        printed = traceback.format_exc()
    jax.config.update("jax_enable_x64", False)
    print(json.dumps(printed), flush=True)
