"""Runs staged work on bounded queues and one worker thread a core; knows nothing of vessels."""

from shipshape.executor.cores import usable_cores
from shipshape.executor.counts import Counts
from shipshape.executor.executor import Executor
from shipshape.executor.lanes import Lane
from shipshape.executor.ticket import Clock, Ended, Rung, Stage, Task, Ticket

__all__ = ["Clock", "Counts", "Ended", "Executor", "Lane", "Rung", "Stage", "Task", "Ticket", "usable_cores"]
