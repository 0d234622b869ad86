"""The command line interface of thingc. Each command has a module, which is imported only when the command is used."""
