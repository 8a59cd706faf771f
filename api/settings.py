"""Settings of the service, read once from the environment and from files of secrets: ranges and texts stand here alone."""

from __future__ import annotations

import difflib
import ipaddress
import os
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, ValidationError, model_validator
from pydantic.fields import FieldInfo
from pydantic_settings import BaseSettings, EnvSettingsSource, PydanticBaseSettingsSource, SecretsSettingsSource, SettingsConfigDict

from rcsa_ident.base.errors import InputError
from rcsa_ident.base.scaleout import ADDRESS

PREFIX = "RCSA_IDENT_"
MEGABYTE = 1_000_000
#: Variables of the same beginning that tests and benchmarks read.
_OTHERS = ("RCSA_IDENT_NO_SKIPS", "RCSA_IDENT_OBSERVER_RESULT")
_SIZES = ((10**12, "TB"), (10**9, "GB"), (10**6, "MB"), (1000, "kB"), (1, "B"))
_Bytes = Annotated[int, "bytes"]
_MiB = Annotated[int, "MiB"]
_Seconds = Annotated[float, "s"]
_Days = Annotated[float, "days"]


class Settings(BaseSettings):
    """Everything that differs between two installations; raises `InputError` where one does not fit.

    Only `from_environment` reads the environment; elsewhere what is not given keeps its default.
    """

    model_config = SettingsConfigDict(env_prefix=PREFIX, frozen=True, extra="forbid")

    data: Path = Field(Path("rcsa-ident-data"), description="folder of the embedded store; made where it is missing")
    database: str = Field("", description="URL of a database in SQLite's place, as `postgresql+psycopg://user@host/name`")
    database_file: Path | None = Field(None, description="a file with that URL, so that its password is in no environment")
    secrets: Path | None = Field(
        None,
        description="a folder of files that are named as these variables and hold their values, as containers get their secrets "
        "(`/run/secrets/RCSA_IDENT_DATABASE`); a variable of the environment counts first",
    )
    host: str = Field("127.0.0.1", description="where the service listens")
    port: int = Field(8000, ge=0, le=65_535, description="its port")
    keys: bool | None = Field(None, description="whether a key is asked for", json_schema_extra={"default": "on unless loopback"})
    tls_certificate: Path | None = Field(None, description="a PEM file; with it the service speaks TLS alone, see [network.md](network.md)")
    tls_key: Path | None = Field(None, description="a PEM file: the private key of the certificate")
    proxies: str = Field(
        "",
        description="addresses or networks, separated by commas, that are believed where they say from whom and by which protocol a "
        "request came, see [network.md](network.md)",
    )
    workers: int = Field(
        default_factory=lambda: max(1, min(os.cpu_count() or 1, 8)),
        ge=1,
        le=256,
        description="processes that answer queries; one more answers a preview while all of these work on longer questions",
        json_schema_extra={"default": "cores (at most 8)"},
    )
    queue: int = Field(64, ge=0, le=100_000, description="queries that may wait for one; beyond that 503")
    connections: int = Field(
        800,
        ge=1,
        le=10**6,
        description="open at once, fewer than the files that a process may open (`ulimit -n`); others are closed",
    )
    connections_per_address: int = Field(
        400, ge=1, le=10**6, description="open at once of one address; behind a proxy all come from its address"
    )
    max_body_bytes: _Bytes = Field(
        16 * MEGABYTE,
        ge=1000,
        le=10**9,
        description="of a body that is no upload; JSON that is not passed on to a process with limits has at most 1 MB; 413",
    )
    requests_per_minute: int = Field(6000, ge=1, le=10**9, description="for each key; 429 with the seconds to wait")
    burst: int = Field(600, ge=1, le=10**9, description="requests of a key that may come at once")
    work_seconds: _Seconds = Field(
        20.0, ge=0.1, le=3600.0, description="estimated work of a query that is answered at once; lobes beyond it become a job, others 422"
    )
    query_seconds: _Seconds = Field(
        60.0,
        ge=0.1,
        le=7200.0,
        description="of one query by the clock, once a process works on it; then the process is ended: lobes become a job, others 422. "
        "A query whose client leaves ends as well",
    )
    query_memory: _MiB = Field(2048, ge=256, le=10**6, description="for one query; ended as above")
    kept_machines: int = Field(4, ge=1, le=1000, description="machines whose receptances each worker keeps")
    streams: int = Field(16, ge=0, le=1000, description="force streams at once")
    streams_per_group: int = Field(8, ge=0, le=1000, description="of one group")
    stream_listeners: int = Field(16, ge=0, le=1000, description="viewers of each stream beside its client")
    stream_idle_seconds: _Seconds = Field(30.0, ge=1.0, le=3600.0, description="without a sample, after which a stream ends")
    stream_buffer_seconds: _Seconds = Field(
        30.0, ge=6.0, le=120.0, description="samples of a stream that may wait; older ones are dropped, and counted"
    )
    max_upload_bytes: _Bytes = Field(2000 * MEGABYTE, ge=1000, le=10**12, description="of one uploaded recording; 413")
    uploads: int = Field(16, ge=1, le=1000, description="uploads at once")
    group_bytes: _Bytes = Field(
        200_000 * MEGABYTE, ge=1000, le=10**15, description="that all uploads of a group may take, what is read from them included; 413"
    )
    group_database_bytes: _Bytes = Field(
        2000 * MEGABYTE, ge=1000, le=10**15, description="that everything else of a group may take in the database; 413"
    )
    free_bytes: _Bytes = Field(1000 * MEGABYTE, ge=0, le=10**15, description="that uploads leave free on the disk")
    upload_seconds: _Seconds = Field(3600.0, ge=1.0, le=10**6, description="of a whole upload; a slower one is given up: 408")
    upload_idle_seconds: _Seconds = Field(30.0, ge=0.1, le=3600.0, description="without a byte of an upload: 408")
    upload_bytes_per_second: int = Field(
        10_000, ge=0, le=10**9, description="below which an upload is given up, after the first `UPLOAD_IDLE_SECONDS`: 408"
    )
    reader_memory: _MiB = Field(2048, ge=512, le=10**6, description="for reading one upload; 422")
    reader_seconds: _Seconds = Field(120.0, ge=0.1, le=10**4, description="of a core, for reading one upload; 422")
    reader_wall_seconds: _Seconds = Field(900.0, ge=0.1, le=10**5, description="by the clock, for reading one upload; 422")
    reader_calls: int = Field(200, ge=1, le=10**6, description="after which the process that reads uploads is replaced")
    job_workers: int = Field(
        1,
        ge=0,
        le=256,
        description="processes for identifications; 0 where `rcsa-ident-serve worker` runs them elsewhere. Each takes about 300 MB (of "
        "which 110 MB are shared with the others) and at most one core",
    )
    lobe_workers: int = Field(1, ge=0, le=256, description="the same for lobes as jobs; kinds never wait for each other")
    path_workers: int = Field(1, ge=0, le=256, description="the same for tools along paths")
    job_memory: _MiB = Field(4096, ge=1024, le=10**6, description="for each process of jobs; a job that needs more has failed")
    job_nice: int = Field(10, ge=0, le=19, description="how far processes for jobs stand behind queries and streams, as `nice`")
    job_queue: int = Field(50, ge=1, le=10**6, description="jobs of a group that may wait or run")
    job_attempts: int = Field(
        10, ge=1, le=1000, description="times that a job is taken up again without coming further before it is given up"
    )
    job_work_seconds: _Seconds = Field(
        4.0 * 3600.0,
        ge=1.0,
        le=10**7,
        description="estimated work of lobes as a job; 422. A tool along a path that has taken longer has failed",
    )
    keep_events_days: _Days = Field(
        0.0, ge=0.0, le=36_500.0, description="after the end of a job, for which its events are kept; 0 for ever"
    )
    keep_results_days: _Days = Field(
        0.0, ge=0.0, le=36_500.0, description="after the end of a job, for which its results are kept; 0 for ever"
    )
    keep_versions_days: _Days = Field(
        0.0,
        ge=0.0,
        le=36_500.0,
        description="for which entries of the trail are kept with their versions, except the newest of each thing; 0 for ever",
    )
    examples: Path = Field(
        Path("data/sample_runs"), description="folder of a campaign that may be downloaded as an example, where it is there"
    )
    dask: str = Field("", description="address of a Dask scheduler for the searches of jobs, as `tcp://host:8786`")
    watchers: int = Field(200, ge=1, le=10**5, description="event streams of jobs at once")
    watch_seconds: _Seconds = Field(
        3600.0, ge=0.1, le=10**6, description="after which such a stream ends; clients go on from its last event"
    )
    unwatched_seconds: _Seconds = Field(
        120.0, ge=60.0, le=10**6, description="after which lobes as a job that a view asked for are cancelled where nobody follows them"
    )

    def __init__(self, **given: Any) -> None:
        try:
            super().__init__(**given)
        except ValidationError as error:
            raise _plain(error) from None

    @classmethod
    def settings_customise_sources(  # type: ignore[override]  # of what it is given by name, it takes one
        cls, settings_cls: type[BaseSettings], init_settings: PydanticBaseSettingsSource, **_others: PydanticBaseSettingsSource
    ) -> tuple[PydanticBaseSettingsSource, ...]:
        """Read arguments alone."""
        return (init_settings,)

    @model_validator(mode="before")
    @classmethod
    def _with_url(cls, given: dict[str, Any]) -> dict[str, Any]:
        file = given.get("database_file")
        return given if file is None else given | {"database": _url_in(Path(file), given.get("database", ""))}

    @model_validator(mode="after")
    def _fit_together(self) -> Settings:
        if self.query_seconds < self.work_seconds:
            raise InputError(f"{PREFIX}QUERY_SECONDS", self.query_seconds, f"at least {PREFIX}WORK_SECONDS, {self.work_seconds:g} s")
        if (self.tls_certificate is None) != (self.tls_key is None):
            missing = "TLS_KEY" if self.tls_key is None else "TLS_CERTIFICATE"
            raise InputError(PREFIX + missing, "nothing", "a PEM file, since certificate and private key belong together")
        for each in filter(None, self.proxies.split(",")):
            try:
                ipaddress.ip_network(each.strip(), strict=False)
            except ValueError:
                raise InputError(
                    f"{PREFIX}PROXIES", each.strip(), "addresses or networks separated by commas, as 10.0.0.7,10.1.0.0/16"
                ) from None
        if self.dask and not ADDRESS.fullmatch(self.dask):
            raise InputError(f"{PREFIX}DASK", self.dask, "the address of a Dask scheduler, as tcp://host:8786")
        if self.keys is False and not self.loopback:
            raise InputError(f"{PREFIX}KEYS", "off", f"on, since the service listens on {self.host}, which other machines reach")
        return self

    @property
    def loopback(self) -> bool:
        """Whether only this machine reaches the service."""
        try:
            return self.host == "localhost" or ipaddress.ip_address(self.host).is_loopback
        except ValueError:
            return False

    @property
    def asks_for_keys(self) -> bool:
        """Whether requests need an API key."""
        return not self.loopback if self.keys is None else self.keys

    @property
    def database_url(self) -> str:
        """URL of the store's database."""
        return self.database or f"sqlite:///{self.data / 'service.db'}"

    @property
    def engine_url(self) -> str:
        """URL of the durable engine's database, which holds the steps of jobs."""
        return self.database or f"sqlite:///{self.data / 'jobs.db'}"


def from_environment(environment: Mapping[str, str]) -> Settings:
    """Return the settings of ``RCSA_IDENT_DATA``, ``RCSA_IDENT_PORT`` and so on; what is not there keeps its default."""
    named = {name: text.strip() for name, text in environment.items() if name.startswith(PREFIX) and text.strip()}
    folder = named.get(f"{PREFIX}SECRETS")
    hidden = {} if folder is None else _secrets(Path(folder))
    _check_names([*(name for name in environment if name.startswith(PREFIX)), *hidden])
    source = EnvSettingsSource(Settings)
    source.env_vars = {name.lower(): text for name, text in {**hidden, **named}.items()}
    try:
        return Settings(**source())
    except InputError as error:
        if error.field in hidden and error.field not in named:
            raise InputError(error.field, "something else in its file", error.allowed, str(folder)) from None
        raise


def _secrets(folder: Path) -> dict[str, str]:
    """Return what the files of a folder hold, by the names of variables; no message repeats it."""
    field, allowed = f"{PREFIX}SECRETS", "a folder of text files that are named as variables"
    if not folder.is_dir():
        raise InputError(field, f"{folder}, which is no folder", allowed)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            found = SecretsSettingsSource(Settings, folder)()
        known = {PREFIX + name.upper(): text for name, text in found.items() if text}
        return dict.fromkeys((each.name for each in folder.iterdir() if each.name.startswith(PREFIX)), "") | known
    except (OSError, ValueError, Warning):
        raise InputError(field, f"{folder} with a file that cannot be read", allowed) from None


def _check_names(names: list[str]) -> None:
    known = [PREFIX + name.upper() for name in Settings.model_fields]
    for name in names:
        if name not in known and name not in _OTHERS:
            near = difflib.get_close_matches(name.removeprefix(PREFIX), [each.removeprefix(PREFIX) for each in known], 1, 0.5)
            hint = f"; did you mean {PREFIX}{near[0]}?" if near else ""
            raise InputError(name, "an unknown setting", f"one that docs/service.md lists{hint}")


def _plain(error: ValidationError) -> InputError:
    """The first of pydantic's errors in the project's words."""
    first = error.errors()[0]
    raised = first.get("ctx", {}).get("error")
    if isinstance(raised, InputError):
        return raised
    name = str(first["loc"][0])
    field = Settings.model_fields.get(name)
    return InputError(PREFIX + name.upper(), first["input"], "one of the settings" if field is None else _allowed(field))


def _allowed(field: FieldInfo) -> str:
    least, most = _range(field)
    if least is None or most is None:
        return "on or off" if field.annotation == bool | None else "a text"
    return f"a {'whole ' if field.annotation is int else ''}number from {least:g} to {most:g}"


def _range(field: FieldInfo) -> tuple[Any, Any]:
    found = [next((getattr(each, name) for each in field.metadata if hasattr(each, name)), None) for name in ("ge", "le")]
    return found[0], found[1]


def table() -> str:
    """Return the table of all settings in Markdown, as docs/service.md has it."""
    lines = ["| variable | default | allowed | what it sets |", "|---|---|---|---|"]
    for name, field in Settings.model_fields.items():
        unit = next((each for each in field.metadata if isinstance(each, str)), "")
        extra = field.json_schema_extra
        default = extra["default"] if isinstance(extra, dict) else _told(field.default, unit)
        least, most = _range(field)
        allowed = "" if least is None else f"{_told(least, unit)} to {_told(most, unit)}"
        lines.append(f"| `{name.upper()}` | {default} | {allowed} | {field.description} |")
    return "\n".join(lines) + "\n"


def _told(value: Any, unit: str) -> str:
    if value is None or value == "":
        return "none"
    if not isinstance(value, int | float):
        return f"`{value}`" if isinstance(value, Path) else str(value)
    if unit == "bytes":
        size, unit = next(each for each in _SIZES if value >= each[0] or each[0] == 1)
        value /= size
    digits = f"{value:,.10g}" if value >= 10_000 else f"{value:g}"
    return digits.replace(",", " ") + f" {unit}" * bool(unit)


def _url_in(path: Path, database: str) -> str:
    """Return the URL that a file holds; no message repeats it, since it may hold a password."""
    field, allowed = f"{PREFIX}DATABASE_FILE", "a file with one line: the URL of the database"
    try:
        lines = path.read_text(encoding="utf-8").split()
    except (OSError, ValueError):
        raise InputError(field, f"{path}, which cannot be read", allowed) from None
    if len(lines) != 1:
        raise InputError(field, f"{path} with {len(lines)} words", allowed)
    if database not in ("", lines[0]):
        raise InputError(field, f"a file beside {PREFIX}DATABASE", "one of the two")
    return lines[0]
