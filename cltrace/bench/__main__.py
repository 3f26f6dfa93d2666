"""`python -m cltrace.bench` is the command cltrace-bench."""

import sys

from .cli import main

sys.exit(main())
