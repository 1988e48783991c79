"""Reads a world file, checks it, and hands it on as frozen records."""

import json
from importlib import resources
from pathlib import Path

import yaml
from pydantic import ValidationError

from sitl.world.build import build_world
from sitl.world.errors import WorldError, WrongKey
from sitl.world.light import LightName
from sitl.world.models import WorldModel
from sitl.world.records import World

__all__ = ["DEFAULT_WORLD", "WorldError", "load_world", "read_world_file", "schema_text", "shipped_worlds"]

DEFAULT_WORLD = "medium_voltage"
_SHIPPED = Path(str(resources.files("sitl"))) / "worlds"


def shipped_worlds() -> list[str]:
    """The names of the worlds that come with the package."""
    return sorted(path.stem for path in _SHIPPED.glob("*.yaml"))


def load_world(name_or_path: str | None = None, light: LightName | None = None) -> World:
    """Read a world: the name of a shipped one, or the path of a YAML file; None is the default world.

    `light` takes the place of the file's.

    Raises WorldError, with a sentence that names the file and the key, when there is no such world or it is wrong.
    """
    where = DEFAULT_WORLD if name_or_path is None else name_or_path
    path = _path_of(where)
    model = read_world_file(where)
    try:
        return build_world(path.stem, model, path.parent, light)
    except WrongKey as error:
        raise WorldError(f"The world file {where} is wrong at {error.key}: {error}.") from error


def read_world_file(where: str) -> WorldModel:
    """What a world file says: the name of a shipped one, or a path. Raises WorldError as load_world does."""
    try:
        text = _path_of(where).read_text(encoding="utf-8")
    except FileNotFoundError:
        known = ", ".join(shipped_worlds())
        raise WorldError(
            f"There is no world '{where}': give the path of a world file or one of these names: {known}."
        ) from None
    except (OSError, UnicodeDecodeError) as error:
        raise WorldError(f"The world file {where} cannot be read as text: {error}.") from error
    data = None
    try:
        data = yaml.load(text, Loader=_Loader)  # noqa: S506 - it is a safe loader
        return WorldModel.model_validate(data)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        line = f", line {mark.line + 1}" if mark is not None else ""
        raise WorldError(f"The world file {where}{line} is not valid YAML; mend it there.") from error
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(_key(first["loc"], data)) or "the whole file"
        message = first["msg"].removeprefix("Value error, ")
        raise WorldError(f"The world file {where} is wrong at {key}: {message}.") from error


def schema_text() -> str:
    """The JSON Schema of a world file, as sitl/worlds/world.schema.json has it."""
    schema = {"$schema": "https://json-schema.org/draft/2020-12/schema", **WorldModel.model_json_schema()}
    return json.dumps(schema, indent=2, ensure_ascii=False) + "\n"


_Loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # libyaml reads long files ten times faster


def _key(location: tuple[int | str, ...], data: object) -> list[str]:
    """The key of an error without the names of kinds that pydantic puts between the file's own keys."""
    parts = []
    for part in location:
        if isinstance(data, dict) and part not in data and part == data.get("kind"):
            continue
        parts.append(str(part))
        is_there = (isinstance(data, dict) and part in data) or (isinstance(data, list) and isinstance(part, int))
        data = data[part] if is_there else None  # type: ignore[index]
    return parts


def _path_of(where: str) -> Path:
    return _SHIPPED / f"{where}.yaml" if where in shipped_worlds() else Path(where)
