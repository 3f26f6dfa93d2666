"""Python imports this at the start of every process that has this folder on PYTHONPATH."""

import mutate

mutate.start()
