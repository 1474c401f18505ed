"""Environment -> frozen settings; every one has a default that works, and a wrong one stops the start."""

import difflib
import os
from pathlib import Path
from typing import Any, Literal

from pydantic import Field, ValidationError, model_validator
from pydantic_settings import BaseSettings, SettingsConfigDict

from shipshape.errors import SettingsError

__all__ = ["PREFIX", "Settings", "SettingsError", "default_bundle", "load_settings"]

PREFIX = "SHIPSHAPE_"


def default_bundle() -> Path:
    """`models` in the current directory, else that of the source checkout this package runs from."""
    here, checkout = Path("models"), Path(__file__).resolve().parents[2] / "models"
    return checkout if not here.is_dir() and checkout.is_dir() else here


class Settings(BaseSettings):
    """Everything an operator may change; each field is the variable SHIPSHAPE_<FIELD>."""

    model_config = SettingsConfigDict(env_prefix=PREFIX, frozen=True, extra="forbid")

    host: str = Field(
        "127.0.0.1",
        description="Address both doors listen on. Loopback keeps strangers out; 0.0.0.0 lets the network in.",
    )
    rest_port: int = Field(8080, ge=0, le=65535, description="TCP port of the REST door; 0 picks a free one.")
    grpc_port: int = Field(50051, ge=0, le=65535, description="TCP port of the gRPC door; 0 picks a free one.")
    share_ports: bool = Field(
        False,
        description="Lets several services listen on the same ports (SO_REUSEPORT); the system spreads "
        "connections among them. One service is the rule: queue, lanes and limits of clients are each one's own.",
    )
    bundle: Path = Field(
        default_factory=default_bundle,
        description="Folder of the model bundle. Default: ./models, else the models of the source checkout.",
    )
    workers: int = Field(
        0,
        ge=0,
        le=1024,
        description="What computes, processes or threads: 0 is one a usable core, with a GPU as many threads as "
        "fill two of its runs. More of them share the same cores: higher latency, no more throughput.",
    )
    compute: Literal["processes", "threads"] = Field(
        "processes",
        description="Where contacts are computed: in `processes` forked from one that holds the bundle, each with "
        "an interpreter for itself, or in `threads` of the service, which share one: less memory, slower. With a "
        "GPU always in threads.",
    )
    provider: Literal["auto", "cpu", "cuda"] = Field(
        "auto",
        description="Where networks run. auto: on an NVIDIA GPU if shipshape[gpu] is installed and finds one, "
        "else on the processor; cuda: the service does not start without a GPU. docs/gpu.md shows how.",
    )
    micro_batches: Literal["auto", "on", "off"] = Field(
        "auto",
        description="Whether contacts that meet at a network share its runs, where they are computed in threads. "
        "auto: as far as it is measured to pay at the start; a processor gains nothing. on is for measuring.",
    )
    queue_limit: int = Field(
        512,
        ge=1,
        le=65536,
        description="Contacts that may wait, at least max_contacts. Longer rides out bursts but lets answers "
        "grow old; shorter refuses sooner.",
    )
    budget_ms: float = Field(
        50.0,
        gt=0,
        description="Milliseconds an answer is meant to take; published to callers. Changes no computation.",
    )
    default_timeout_ms: float = Field(
        5000.0,
        gt=0,
        le=3_600_000,
        description="Milliseconds a request may take when its caller sets no deadline. Long enough that a full "
        "queue on one core is still answered, and people get their pictures; programs should set their own.",
    )
    drain_s: float = Field(
        10.0,
        ge=0,
        description="Seconds that requests under way may still take after SIGTERM. Must be shorter than the "
        "grace of whatever sends the signal.",
    )
    linger_s: float = Field(
        0.0,
        ge=0,
        le=3600,
        description="Seconds that a service which was told to stop is not ready but still takes requests, until "
        "whatever spreads them has noticed; a second signal ends it. 0: aboard nothing spreads them, and each "
        "second would only put off the restart. Kubernetes and balancers need about 5.",
    )
    health_port: int | None = Field(
        None,
        ge=0,
        le=65535,
        description="TCP port that serves /startedz, /livez, /readyz and /metrics alone, always in plain HTTP, "
        "for probes that speak neither TLS nor tokens; 0 picks a free one. Absent: none.",
    )
    health_host: str = Field("127.0.0.1", description="Address the health port listens on.")
    admin_port: int | None = Field(
        None,
        ge=0,
        le=65535,
        description="TCP port of the admin door, which changes the bundle and drains; 0 picks a free one. "
        "Absent: none. It needs admin_token_file.",
    )
    admin_host: str = Field(
        "127.0.0.1",
        description="Address the admin door listens on, in plain HTTP: leave it on loopback, ssh can carry it.",
    )
    admin_token_file: Path | None = Field(
        None,
        description="File of lines NAME SHA256HEX: who may call the admin door. It holds no token.",
    )
    bundle_root: Path | None = Field(
        None,
        description="The admin door takes bundles from folders below this one alone. Absent: the folder that "
        "holds `bundle`.",
    )
    shadow_share: float = Field(
        0.1,
        ge=0,
        le=1,
        description="Share of the contacts answered that a shadow bundle (`shipshape admin shadow`) is compared "
        "on. Each is computed twice more, where workers are free; without a shadow it changes nothing.",
    )
    max_body_bytes: int = Field(
        16 * 2**20,
        ge=1024,
        le=2**30,
        description="Bytes of one request. Larger admits bigger scans, each held in memory while it is read.",
    )
    max_points: int = Field(
        65536,
        ge=1000,  # the built-in contact of the warm-up
        description="Points of one contact, at least 1000. Bounds the time one contact can take from all the "
        "others.",
    )
    max_contacts: int = Field(256, ge=1, description="Contacts of one scan. They are queued all at once.")
    tls_certificate: Path | None = Field(
        None,
        description="PEM file of the certificate of both doors, followed by its intermediate ones; with tls_key. "
        "None speaks plain HTTP and gRPC. Read again within a second of a change, as are all files below.",
    )
    tls_key: Path | None = Field(None, description="PEM file of the certificate's private key, not encrypted.")
    tls_client_ca: Path | None = Field(
        None,
        description="PEM file of the authorities whose client certificates are accepted; a client without one is "
        "then refused (mTLS). None asks for no certificate.",
    )
    tokens_file: Path | None = Field(
        None,
        description="File of NAME SHA256HEX lines, as `shipshape token NAME` prints them; a caller without one of "
        "these tokens is refused. None asks for no token.",
    )
    client_contacts_per_s: float = Field(
        0.0,
        ge=0,
        allow_inf_nan=False,
        description="Contacts a second that one client may ask for; 0 sets no limit. A client is a token, else a "
        "client certificate, else an address.",
    )
    client_burst: int = Field(
        512,
        ge=1,
        description="Contacts that one client may ask for at once after a rest, at least max_contacts; holds with "
        "client_contacts_per_s alone.",
    )
    client_under_way: int = Field(
        0,
        ge=0,
        description="Contacts of one client that may wait or be computed, at least max_contacts; 0 sets no limit. "
        "Below queue_limit, it keeps one client from filling the queue.",
    )
    log_level: Literal["debug", "info", "warning", "error"] = Field(
        "info", description="Least severe log line written; debug adds one line a request."
    )
    traces_url: str | None = Field(
        None,
        pattern="^https?://",
        description="Collector of OpenTelemetry that spans are sent to, OTLP over HTTP, such as "
        "http://127.0.0.1:4318/v1/traces; needs the extra shipshape[otel]. None makes no spans and sends nothing.",
    )
    traces_share: float = Field(
        1.0,
        ge=0,
        le=1,
        description="Share of the requests to make spans of, where their callers have not decided it. Each costs "
        "a fraction of a millisecond of a core; the log names the trace of all.",
    )

    @model_validator(mode="after")
    def _a_scan_fits_the_queue(self) -> "Settings":
        if self.queue_limit < self.max_contacts:
            raise ValueError(
                f"expected {PREFIX}QUEUE_LIMIT to hold a whole scan, {PREFIX}MAX_CONTACTS = {self.max_contacts}, "
                f"got {self.queue_limit}"
            )
        return self

    @model_validator(mode="after")
    def _a_scan_fits_the_limits_of_a_client(self) -> "Settings":
        limits = {"CLIENT_BURST": self.client_burst if self.client_contacts_per_s else 0}
        limits["CLIENT_UNDER_WAY"] = self.client_under_way
        for name, limit in limits.items():
            if 0 < limit < self.max_contacts:
                raise ValueError(
                    f"expected {PREFIX}{name} to hold a whole scan, {PREFIX}MAX_CONTACTS = {self.max_contacts}, "
                    f"got {limit}"
                )
        return self

    @model_validator(mode="after")
    def _the_admin_door_has_a_token(self) -> "Settings":
        if self.admin_port is not None and self.admin_token_file is None:
            raise ValueError(f"expected {PREFIX}ADMIN_TOKEN_FILE beside {PREFIX}ADMIN_PORT, got none")
        return self

    @model_validator(mode="after")
    def _tls_is_whole(self) -> "Settings":
        if (self.tls_certificate is None) != (self.tls_key is None):
            raise ValueError(f"expected both {PREFIX}TLS_CERTIFICATE and {PREFIX}TLS_KEY, got one of them")
        if self.tls_client_ca is not None and self.tls_certificate is None:
            raise ValueError(f"expected {PREFIX}TLS_CLIENT_CA beside {PREFIX}TLS_CERTIFICATE, got it alone")
        return self


def load_settings(**overrides: Any) -> Settings:
    """The settings of the environment, with `overrides` (from the command line) above them.

    Raises:
        SettingsError: An unknown SHIPSHAPE_* variable, or a value that cannot work.
    """
    # pydantic-settings passes over variables it does not know, even with extra="forbid".
    known = {f"{PREFIX}{name}".upper() for name in Settings.model_fields}
    unknown = sorted(name for name in os.environ if name.upper().startswith(PREFIX) and name.upper() not in known)
    if unknown:
        near = difflib.get_close_matches(unknown[0].upper(), known, 1)
        meant = f": did you mean {near[0]}?" if near else ""
        raise SettingsError(f"expected only known {PREFIX}* variables, got {', '.join(unknown)}{meant}")
    try:
        return Settings(**overrides)
    except ValidationError as error:
        raise SettingsError(_first_complaint(error)) from error


def _first_complaint(error: ValidationError) -> str:
    first = error.errors(include_url=False)[0]
    if not first["loc"]:  # of two settings together: the validator's own sentence; the input is all settings
        return str(first["ctx"]["error"])
    name = ".".join(map(str, first["loc"]))
    return f"expected another value of {PREFIX}{name.upper()}, got {first['input']!r:.80}: {first['msg']}"
