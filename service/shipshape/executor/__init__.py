"""Runs staged work on a bounded queue and one worker thread a core; knows nothing of vessels."""

from shipshape.executor.cores import usable_cores
from shipshape.executor.executor import Counts, Executor
from shipshape.executor.ticket import Clock, Stage, Task, Ticket

__all__ = ["Clock", "Counts", "Executor", "Stage", "Task", "Ticket", "usable_cores"]
