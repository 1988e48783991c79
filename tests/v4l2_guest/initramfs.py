"""The guest's first files: a shell, the modules that lead to the host's files and to a virtual camera, and `init`."""

import lzma
import shutil
import subprocess
from pathlib import Path
from tempfile import TemporaryDirectory

from tests.v4l2_guest.debian import Parts

INIT = Path(__file__).with_name("init")
# What `init` loads by name; modules.dep tells what these need.
MODULES = frozenset({"virtio_pci", "9pnet_virtio", "9p", "vivid"})


def write_initramfs(parts: Parts, command: str, target: Path) -> None:
    """Write an initramfs to `target` that runs `command`, a line of shell, among the host's files."""
    with TemporaryDirectory(dir=target.parent) as scratch:
        root = Path(scratch)
        (root / "bin").mkdir()
        shutil.copy(parts.busybox, root / "bin/busybox")
        shutil.copy(INIT, root / "init")
        (root / "init").chmod(0o755)
        (root / "command").write_text(command, encoding="utf-8")
        _copy_modules(parts.modules, root / "lib/modules" / parts.modules.name)
        names = "\n".join(str(path.relative_to(root)) for path in sorted(root.rglob("*")))
        with target.open("wb") as archive:
            subprocess.run(
                ["cpio", "--create", "--format=newc", "--quiet"],
                cwd=root,
                input=names.encode(),
                stdout=archive,
                check=True,
            )


def _copy_modules(source: Path, target: Path) -> None:
    """Copy MODULES and what they need. Compressed ones are unpacked, for busybox may not be able to."""
    dependencies = (source / "modules.dep").read_text(encoding="utf-8")
    needed: set[str] = set()
    for line in dependencies.splitlines():
        module, _, others = line.partition(":")
        if Path(module).name.partition(".")[0] in MODULES:
            needed |= {module, *others.split()}
    for module in needed:
        content = (source / module).read_bytes()
        copy = target / module.removesuffix(".xz")
        copy.parent.mkdir(parents=True, exist_ok=True)
        copy.write_bytes(lzma.decompress(content) if module.endswith(".xz") else content)
    (target / "modules.dep").write_text(dependencies.replace(".ko.xz", ".ko"), encoding="utf-8")
