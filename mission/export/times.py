"""Unix time in words."""

from datetime import UTC, datetime

from drivers.clock import NS_PER_S


def utc(unix_ns: int) -> datetime:
    """A time since 1970 [ns] as a date in UTC, to the microsecond."""
    whole_s, rest_ns = divmod(unix_ns, NS_PER_S)
    return datetime.fromtimestamp(whole_s, UTC).replace(microsecond=rest_ns // 1000)


def iso_utc(unix_ns: int) -> str:
    """A time since 1970 [ns] in ISO 8601, to the millisecond: 2026-05-01T09:30:00.125Z."""
    return utc(unix_ns).isoformat(timespec="milliseconds").replace("+00:00", "Z")
