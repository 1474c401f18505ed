"""Chunks -> parts on all cores: processes that fork once the bundle is loaded, so that all share one copy of it.

The one place that knows how work is spread over a machine.
"""

import ctypes
import gc
import multiprocessing
import os
import signal
import sys
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from multiprocessing.connection import wait

from shipshape.batch.units import Chunk, Ending, Part
from shipshape.errors import ShipshapeError

Work = Callable[[Chunk], Part]
AHEAD = 3  # chunks of each worker that are read before their turn; bounds memory
POINTS_AHEAD = 2**25  # of all these chunks together, 0.4 GB; one cloud may have as many
PR_SET_PDEATHSIG = 1  # of linux/prctl.h

_work: Work  # of a worker process


def fork_workers(work: Work, count: int) -> Executor:
    """Processes that have all that this one has loaded. To be called before any thread is started.

    They are forked and not spawned: each that loads a bundle of its own and compiles again takes seconds and
    hundreds of megabytes. ONNX Runtime has no threads here, with one a session; numba starts none either.
    """
    gc.freeze()  # a collection in a worker would write to each page of what it shares
    context = multiprocessing.get_context("fork")
    executor = ProcessPoolExecutor(count, mp_context=context, initializer=_begin, initargs=(work, os.getpid()))
    executor.submit(os.getpid).result()  # the first task forks them all
    return executor


def run_in_processes(executor: Executor, count: int, chunks: Iterable[Chunk | Ending]) -> Iterator[Part | Ending]:
    """The parts of all chunks, in the order of the chunks, and the endings between them.

    Args:
        executor: What `fork_workers` gave.
        count: Of its processes.
        chunks: Read a few ahead of the part that is awaited.

    Raises:
        ShipshapeError: A worker died.
    """
    yield from run_ahead(executor, _run, chunks, AHEAD * count)


def run_ahead(
    executor: Executor, work: Work, chunks: Iterable[Chunk | Ending], ahead: int
) -> Iterator[Part | Ending]:
    """As `run_in_processes`, by any executor, at most `ahead` chunks before the part that is awaited."""
    waiting: deque[tuple[Future[Part] | Ending, int]] = deque()  # and the points of each
    held = 0
    try:
        for item in chunks:
            if isinstance(item, Ending):
                waiting.append((item, 0))
            else:
                waiting.append((executor.submit(work, item), item.points))
                held += item.points
            while len(waiting) > ahead or held > POINTS_AHEAD or (waiting and _is_ready(waiting[0][0])):
                taken, points = waiting.popleft()
                held -= points
                yield _take(taken)
        for taken, _ in waiting:
            yield _take(taken)
    except BrokenProcessPool as error:
        raise ShipshapeError(
            "expected every worker to live, but one died, for want of memory perhaps: run the same command again, "
            "with fewer --workers, it goes on where it was stopped"
        ) from error
    finally:
        executor.shutdown(wait=True, cancel_futures=True)


def _is_ready(item: Future[Part] | Ending) -> bool:
    return isinstance(item, Ending) or item.done()


def _take(item: Future[Part] | Ending) -> Part | Ending:
    return item if isinstance(item, Ending) else item.result()


def _begin(work: Work, parent: int) -> None:
    """In a worker: it leaves Ctrl-C to its parent, and does not outlive it."""
    global _work  # noqa: PLW0603  a worker gets its work when it is forked, a task can carry only its chunk
    _work = work
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if sys.platform == "linux":
        # By the kernel, so that a worker has one thread: with a second one each allocation takes locks.
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    else:
        threading.Thread(target=_end_with_parent, daemon=True).start()
    if os.getppid() != parent:
        os._exit(1)


def _end_with_parent() -> None:
    if (parent := multiprocessing.parent_process()) is not None:
        wait([parent.sentinel])
        os._exit(1)


def _run(chunk: Chunk) -> Part:
    return _work(chunk)
