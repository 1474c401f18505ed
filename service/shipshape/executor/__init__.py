"""Runs staged work on bounded queues and one worker a core, a thread or a process; knows nothing of vessels."""

from shipshape.executor.cores import usable_cores
from shipshape.executor.costs import Costs
from shipshape.executor.counts import Counts
from shipshape.executor.executor import Executor
from shipshape.executor.lanes import Lane
from shipshape.executor.process_crew import ProcessCrew
from shipshape.executor.process_worker import Prepared
from shipshape.executor.ticket import Clock, Ended, Rung, Stage, Task, Ticket
from shipshape.executor.worker import rehearse

__all__ = [
    "Clock",
    "Costs",
    "Counts",
    "Ended",
    "Executor",
    "Lane",
    "Prepared",
    "ProcessCrew",
    "Rung",
    "Stage",
    "Task",
    "Ticket",
    "rehearse",
    "usable_cores",
]
