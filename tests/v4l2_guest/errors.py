"""The guest's one error."""


class GuestError(Exception):
    """The guest could not be made, or did not reach its end; the message is one sentence for a person."""
