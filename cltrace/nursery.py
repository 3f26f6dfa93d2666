"""What the process imports of which the workers of a local cluster are forks, see forks."""

from cltrace.start import imported

imported("cltrace.distributed.workers")
