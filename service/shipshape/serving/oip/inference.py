"""A request's tensors through the core: contacts in, one row a contact out."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from shipshape.executor import Lane, Ticket
from shipshape.serving.clients import Share
from shipshape.serving.core import Core, Scan, conclude, outcome_of
from shipshape.serving.model import Answer, Model, Order, Reply
from shipshape.serving.oip.convention import count_contacts, to_contacts
from shipshape.serving.oip.models import classes_of
from shipshape.serving.oip.parameters import timeout_s, to_wishes
from shipshape.serving.oip.results import RESTORED, encode, output_specs, to_tensors
from shipshape.serving.oip.tensors import Tensor, TensorSpec
from shipshape.telemetry import Metrics, Outcome
from shipshape.types import Contact


@dataclass(frozen=True, slots=True)
class InferRequest:
    """An inference request, whichever wire it came over."""

    inputs: Mapping[str, Tensor]
    outputs: Sequence[str] = ()  # names; none: all but the restored clouds
    parameters: Mapping[str, Any] | None = None


@dataclass(frozen=True, slots=True)
class Inference:
    """Contacts on their way: one that fails as a whole when it is refused, or a scan whose contacts fail alone."""

    specs: Sequence[TensorSpec]
    contact_ids: Sequence[str]
    work: Ticket[Reply[Answer]] | Scan[Answer]
    classes: int

    @property
    def tickets(self) -> list[Ticket[Reply[Answer]]]:
        """Of all contacts that were admitted."""
        return self.work.tickets if isinstance(self.work, Scan) else [self.work]

    @property
    def bulky(self) -> bool:
        """Whether the outputs hold whole clouds."""
        return any(spec in RESTORED for spec in self.specs)

    def conclude(self, door: str, metrics: Metrics, outcome: Outcome) -> tuple[list[Tensor], dict[str, float]]:
        """Wait, count the contacts, and tell `outcome` when the only one is of a lower rung.

        Returns:
            The outputs, and the milliseconds of each stage over all contacts.

        Raises:
            Exception: What refused the only contact; DeadlineExceeded, Cancelled, NotReady as `Scan.outcomes`.
        """
        if isinstance(self.work, Scan):
            outcomes, stage_ms = conclude(self.work, door, metrics)
            return to_tensors(self.specs, self.contact_ids, outcomes, self.classes), stage_ms
        reply = self.work.result()
        outcome.kind = outcome_of(reply)
        metrics.count_contacts(door, [outcome.kind])
        return to_tensors(self.specs, self.contact_ids, [reply], self.classes), dict(reply.stage_ms)


def submit(
    core: Core, model: Model, request: InferRequest, deadline: float, outcome: Outcome, share: Share
) -> Inference:
    """Queue the contacts of a request.

    Args:
        core: Answers.
        model: From `find_model`.
        request: As it came.
        deadline: From `Core.deadline_in`; parameter timeout can only bring it nearer.
        outcome: Told how many contacts there are, and whether they are urgent.
        share: Of its caller, which the contacts are taken from.

    Raises:
        InvalidInput: Tensors or parameters that do not make contacts and wishes.
        Overloaded, DeadlineExceeded, NotReady: As `Core.submit_scan`.
    """
    outcome.contacts = count_contacts(request.inputs)
    share.take(min(outcome.contacts, core.limits.max_contacts))
    parameters = request.parameters or {}
    specs = output_specs(request.outputs)
    wishes = to_wishes(parameters, restored=any(spec in RESTORED for spec in specs))
    outcome.urgent = wishes.lane is not Lane.BATCH
    seconds = timeout_s(parameters)
    if seconds is not None:
        deadline = min(deadline, core.deadline_in(seconds))
    ids, contacts = to_contacts(request.inputs, core.limits)
    work: Ticket[Reply[Answer]] | Scan[Answer]
    if len(contacts) == 1:
        (only,) = contacts
        if not isinstance(only, Contact):
            raise only
        work = core.submit(model, Order(only, wishes, encode), deadline)
    else:
        work = core.submit_scan(model, contacts, wishes, encode, deadline)
    return Inference(specs, ids, work, len(classes_of(model)))
