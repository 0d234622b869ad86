"""`python -m thingc` is the command `thingc`."""

from thingc.cli.main import entry

entry()
