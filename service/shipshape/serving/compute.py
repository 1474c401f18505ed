"""On what a service computes, and in how many processes or threads: the one place that decides it."""

from shipshape.executor import usable_cores
from shipshape.micro_batches import BUCKETS
from shipshape.providers import Provider, Runtime, find_provider
from shipshape.settings import Settings


def runtime_of(settings: Settings) -> Runtime:
    """Where the networks of every bundle run, the first one and those that are swapped in.

    Raises:
        SettingsError: A GPU was asked for and does not work here.
    """
    return Runtime(find_provider(settings.provider), settings.micro_batches)


def workers_of(settings: Settings, provider: Provider) -> int:
    """What computes: a usable core each, or, for a GPU, the threads of one full run and those of the next.

    While a GPU runs one batch, its contacts' threads wait; as many others prepare the batch that comes next.
    """
    if settings.workers:
        return settings.workers
    return usable_cores() if provider is Provider.CPU else 2 * BUCKETS[-1]


def in_processes(settings: Settings, provider: Provider) -> bool:
    """Whether contacts are computed in worker processes: a GPU wants all of them in one."""
    return settings.compute == "processes" and provider is Provider.CPU
