"""The export's errors, apart from its work so that the command line can name them without loading it."""


class ExportError(Exception):
    """A log cannot be exported in this way; the message is one sentence for a person."""


class OutputError(Exception):
    """What was exported could not be written; the message is one sentence for a person."""
