"""One file for each command, which is also the function `joda.add`, `joda.compare`, ...; `joda.cli`
only parses and prints."""
