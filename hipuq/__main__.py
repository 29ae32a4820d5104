"""``python -m hipuq`` is the command line."""

from hipuq.cli import command

command()
