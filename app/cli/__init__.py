"""The command line: the same engine with no screen, no device and no database."""
