"""Why an autopilot's log cannot be imported. The messages are one sentence for a person."""


class AutopilotLogError(Exception):
    """The file is not a log that can be read, or holds no flight."""


class NoMatchError(Exception):
    """The two logs' motion does not show that they are of one flight."""
