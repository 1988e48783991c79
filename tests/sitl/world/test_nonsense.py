"""Whatever a world file says, it is a world or one sentence."""

import copy
from pathlib import Path

import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from sitl.world.errors import WorldError
from sitl.world.file import load_world
from sitl.world.records import World

FILES = [
    yaml.safe_load((Path(__file__).parents[3] / "sitl" / "worlds" / f"{name}.yaml").read_text(encoding="utf-8"))
    for name in ("high_voltage", "village", "hills", "crossing")
]
junk = st.one_of(
    st.none(), st.booleans(), st.integers(-400, 400), st.floats(), st.text(max_size=5), st.just([]), st.just({}),
    st.lists(st.floats(-500, 500), max_size=4), st.sampled_from(["lattice_tower", "wood_pole", "hills", "column"]),
)  # fmt: skip


def mutate(node: object, data: st.DataObject) -> object:
    """The same tree with one value, somewhere, another one or gone."""
    keys = list(node) if isinstance(node, dict) else list(range(len(node))) if isinstance(node, list) else []
    if not keys or data.draw(st.integers(0, 5)) == 0:
        return data.draw(junk)
    key = data.draw(st.sampled_from(keys))
    if data.draw(st.integers(0, 9)) == 0:
        del node[key]  # type: ignore[index, attr-defined]
    else:
        node[key] = mutate(node[key], data)  # type: ignore[index]
    return node


@settings(max_examples=300, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_a_mangled_file_is_a_world_or_a_sentence(tmp_path: Path, data: st.DataObject) -> None:
    mangled = copy.deepcopy(data.draw(st.sampled_from(FILES)))
    for _ in range(data.draw(st.integers(1, 3))):
        mangled = mutate(mangled, data)
    path = tmp_path / "mine.yaml"
    path.write_text(yaml.safe_dump(mangled), encoding="utf-8")
    try:
        world = load_world(str(path))
    except WorldError as error:
        said = str(error)
    else:
        assert isinstance(world, World)
        said = "It loads."
    assert said.endswith(".")
    assert not said.endswith("..")


@pytest.mark.parametrize(
    "text", ["version: 2020-13-45\n", "a: " + 5000 * "[", "\x07", "version: !!python/object:os.system {}\n"]
)
def test_text_that_is_hardly_yaml_is_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(WorldError, match=r"mine\.yaml"):
        load_world(str(path))
