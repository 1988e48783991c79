"""YAML text to data, with the line of every key; refuses what a file that people write should not hold."""

from collections.abc import Hashable, Iterator, Mapping
from dataclasses import dataclass

import yaml

Location = tuple[str | int, ...]


@dataclass(frozen=True, slots=True)
class Problem:
    """One error of a file: the line [1-based], the key's path (empty: the whole file), what is wrong."""

    line: int
    key: str
    message: str


class DocumentError(Exception):
    """The text cannot be read as a document; `problems` say why."""

    def __init__(self, problems: list[Problem]) -> None:
        self.problems = problems
        super().__init__("; ".join(problem.message for problem in problems))


@dataclass(frozen=True, slots=True)
class Document:
    """The data of a YAML text, and the line [1-based] of each key and item."""

    data: object
    lines: Mapping[Location, int]

    def line(self, location: Location) -> int:
        """The line of the location, or of its nearest parent that stands in the file."""
        while location not in self.lines and location:
            location = location[:-1]
        return self.lines.get(location, 1)


def key_path(location: Location) -> str:
    """A location as people write it: `tasks[3].turn`."""
    text = ""
    for part in location:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if text else part
    return text


def parse_document(text: str) -> Document:
    """Parse YAML. Raises DocumentError for bad YAML, aliases, tags, a key that stands twice, and absurd nesting."""
    try:
        root = _compose(text)
        duplicates = [] if root is None else list(_duplicate_keys(root, ()))
        if duplicates:
            raise DocumentError(duplicates)
        return Document(_construct(root), {} if root is None else _lines_of(root))
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark
        words = f"not valid YAML: {error.problem or error.context}"
        raise DocumentError([Problem(1 if mark is None else mark.line + 1, "", words)]) from None
    except (yaml.YAMLError, ValueError, OverflowError) as error:
        raise DocumentError([Problem(1, "", f"not valid YAML: {str(error).splitlines()[0]}")]) from None
    except RecursionError:
        raise DocumentError([Problem(1, "", "nested too deeply to be a file that a person wrote")]) from None


class _Loader(yaml.SafeLoader):
    """Refuses what the reader of a mission must not meet."""

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        """Refuse aliases, a few of which can stand for gigabytes, and tags, which PyYAML does not always survive."""
        event = self.peek_event()  # type: ignore[no-untyped-call]
        if isinstance(event, yaml.AliasEvent):
            raise _refusal(event, "YAML aliases (*name) are not allowed; write it out")
        if getattr(event, "tag", None) is not None:
            raise _refusal(event, "YAML tags (!name) are not allowed; write the value alone")
        return super().compose_node(parent, index)


def _refusal(event: yaml.Event, words: str) -> DocumentError:
    line = 1 if event.start_mark is None else event.start_mark.line + 1
    return DocumentError([Problem(line, "", words)])


def _compose(text: str) -> yaml.Node | None:
    loader = _Loader(text)
    try:
        return loader.get_single_node()
    finally:
        loader.dispose()


def _construct(root: yaml.Node | None) -> object:
    loader = _Loader("")
    try:
        return None if root is None else loader.construct_document(root)
    finally:
        loader.dispose()


def _duplicate_keys(node: yaml.Node, location: Location) -> Iterator[Problem]:
    """YAML lets a later key silently replace an earlier one; in a mission that is a mistake."""
    if isinstance(node, yaml.MappingNode):
        seen: set[Hashable] = set()
        for key, value in node.value:
            here = (*location, str(key.value))
            if here in seen:
                yield Problem(key.start_mark.line + 1, key_path(here), "this key stands here twice; keep one")
            seen.add(here)
            yield from _duplicate_keys(value, here)
    elif isinstance(node, yaml.SequenceNode):
        for index, value in enumerate(node.value):
            yield from _duplicate_keys(value, (*location, index))


def _lines_of(root: yaml.Node) -> dict[Location, int]:
    lines: dict[Location, int] = {}

    def visit(node: yaml.Node, location: Location, line: int) -> None:
        lines[location] = line
        if isinstance(node, yaml.MappingNode):
            for key, value in node.value:
                visit(value, (*location, str(key.value)), key.start_mark.line + 1)
        elif isinstance(node, yaml.SequenceNode):
            for index, value in enumerate(node.value):
                visit(value, (*location, index), value.start_mark.line + 1)

    visit(root, (), root.start_mark.line + 1)
    return lines
