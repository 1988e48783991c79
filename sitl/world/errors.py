"""What can be wrong with a world file."""


class WorldError(Exception):
    """A world could not be read; the message is one sentence for a person."""


class WrongKey(ValueError):
    """What one key of a world file says cannot be built; the file's reader makes a WorldError of it.

    `key` is written as in errors of types: lines.0.route.
    """

    def __init__(self, key: str, message: str) -> None:
        super().__init__(message)
        self.key = key
