"""One file for each command: the function `joda.add`, `joda.compare`, ..., which what it returns is
documented with, and the command line `command`, which parses, calls the function and prints.

`attach`, `compile`, `context` and `render` are functions of the packages below, which use them
too; here is their command line. `joda.cli` loads the one file that is asked for.
"""
