"""Waiting for tickets on the event loop: one awakening for many, none forgotten, nothing left behind."""

import asyncio
import threading
import time
from types import SimpleNamespace

import pytest

from shipshape.errors import Cancelled, DeadlineExceeded
from shipshape.executor import Executor, Ticket
from shipshape.serving.rest.connection import Connection
from shipshape.serving.rest.mailbox import Mailbox
from shipshape.serving.rest.waiting import until_settled

PATIENCE = 10.0


def ticket():
    return Ticket(time.monotonic() + PATIENCE, time.monotonic)


def incoming(mailbox=None, connection=None):
    return SimpleNamespace(mailbox=mailbox or Mailbox(), connection=connection or Connection("address x"))


def wait(*tickets, **of):
    return until_settled(tickets, incoming(**of))


def test_what_is_settled_is_not_waited_for():
    async def main():
        done = ticket()
        done.succeed(1)
        waiting = wait(done)
        with pytest.raises(StopIteration):
            waiting.send(None)
        with pytest.raises(StopIteration):
            wait().send(None)

    asyncio.run(main())


def test_all_tickets_of_a_scan_are_waited_for():
    async def main():
        tickets = [ticket() for _ in range(5)]
        waiting = asyncio.create_task(wait(*tickets))
        for each in tickets:
            await asyncio.sleep(0)
            assert not waiting.done()
            each.succeed(None)
        await asyncio.wait_for(waiting, PATIENCE)

    asyncio.run(main())


def test_many_tickets_that_are_settled_at_once_cost_one_awakening(monkeypatch):
    async def main():
        loop, mailbox, woken = asyncio.get_running_loop(), Mailbox(), []
        call_soon_threadsafe = loop.call_soon_threadsafe
        monkeypatch.setattr(
            loop, "call_soon_threadsafe", lambda *args: woken.append(1) or call_soon_threadsafe(*args)
        )
        tickets = [ticket() for _ in range(100)]
        waiting = [asyncio.create_task(wait(each, mailbox=mailbox)) for each in tickets]
        await asyncio.sleep(0)
        for each in tickets:
            each.succeed(None)
        await asyncio.wait_for(asyncio.gather(*waiting), PATIENCE)
        assert len(woken) == 1

    asyncio.run(main())


def test_no_ticket_is_forgotten_however_many_threads_settle_them():
    async def main():
        mailbox, count = Mailbox(), 4000
        tickets = [ticket() for _ in range(count)]

        def settle(mine):
            for each in mine:
                each.succeed(None)

        threads = [threading.Thread(target=settle, args=(tickets[start::4],)) for start in range(4)]
        waiting = [asyncio.create_task(wait(each, mailbox=mailbox)) for each in tickets]
        for thread in threads:
            thread.start()
        await asyncio.wait_for(asyncio.gather(*waiting), PATIENCE)
        for thread in threads:
            thread.join()
        assert not mailbox._settled

    asyncio.run(main())


@pytest.mark.parametrize("before", [True, False])
def test_a_client_that_leaves_cancels_what_it_waits_for(before):
    async def main():
        connection, tickets = Connection("address x"), [ticket(), ticket()]
        tickets[0].succeed("there")
        if before:
            connection.lose()
        waiting = asyncio.create_task(wait(*tickets, connection=connection))
        await asyncio.sleep(0)
        connection.lose()
        await asyncio.wait_for(waiting, PATIENCE)
        assert tickets[0].result() == "there"
        with pytest.raises(Cancelled):
            tickets[1].result()
        assert not connection._watchers

    asyncio.run(main())


def test_a_task_that_is_ended_cancels_what_it_waits_for():
    async def main():
        connection, pending = Connection("address x"), ticket()
        waiting = asyncio.create_task(wait(pending, connection=connection))
        await asyncio.sleep(0)
        waiting.cancel()
        with pytest.raises(asyncio.CancelledError):
            await waiting
        with pytest.raises(Cancelled):
            pending.result()
        assert not connection._watchers

    asyncio.run(main())


def test_the_executor_ends_the_wait_at_the_deadline():
    executor = Executor(1, 4)

    async def main():
        late = Ticket(time.monotonic() + 0.01, time.monotonic)
        executor._deadlines.watch(late)
        await asyncio.wait_for(wait(late), PATIENCE)
        with pytest.raises(DeadlineExceeded):
            late.result()

    asyncio.run(main())
    executor.stop(1.0)


def test_a_ticket_that_is_settled_after_the_loop_has_ended_harms_nobody(caplog):
    pending = ticket()

    async def main():
        waiting = asyncio.create_task(wait(Ticket(time.monotonic(), time.monotonic)))
        mailbox = Mailbox()
        mailbox.wait_for([pending])
        await asyncio.sleep(0)
        waiting.cancel()

    asyncio.run(main())
    pending.succeed(None)
    assert not caplog.records
