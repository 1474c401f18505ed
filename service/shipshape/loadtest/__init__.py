"""Proves a latency budget against a running service, as a client that never waits for it.

arrivals + mixture -> plan -> processes, a `Sender` each -> target -> records -> summary -> verdict -> table, page

Nothing of the service imports this package, and it imports nothing of the service's doors.
"""
