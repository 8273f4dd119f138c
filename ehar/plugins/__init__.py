"""A user's own classes: named on the command line, loaded from a file or a module, and made."""
