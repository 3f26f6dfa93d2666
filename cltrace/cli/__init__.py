"""The command `cltrace`: options, messages, exit codes. What the tracer has to say is said here.

options says what can be asked for, command follows it, and each other module does one kind of work. What only some
options need is imported where they are followed: imports are half of a small picture's time.
"""

from __future__ import annotations

from cltrace.cli.command import main
from cltrace.cli.options import parser

__all__ = ["main", "parser"]
