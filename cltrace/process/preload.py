"""Imported by the process of which the workers of a local cluster are forks, see forkserver: what they need."""

import os

from cltrace.process.entry import imported
from cltrace.process.forkserver import MODULE

imported(os.environ[MODULE])
