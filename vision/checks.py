"""Checks that the vision room's settings have in common."""


def check_shares(settings: object, *names: str) -> None:
    """Raise ValueError when one of the named fields of `settings` is no share: above 0 and at most 1."""
    for name in names:
        value = getattr(settings, name)
        if not 0.0 < value <= 1.0:
            raise ValueError(f"{name} is {value}, but it is a share: choose it above 0 and at most 1.")
