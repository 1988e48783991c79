"""The log's error, apart from its records so that the command line can name it without loading them."""


class LogError(Exception):
    """A log could not be written or read; the message is one sentence for a person."""
