"""What the guest is made of, from Debian: the programs that run it, its kernel with all modules, and its shell."""

import os
import platform
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from tests.v4l2_guest.errors import GuestError

PROGRAMS = {"qemu-system-x86_64": "qemu-system-x86", "cpio": "cpio", "depmod": "kmod"}
# depmod lies where not every user's path leads.
SEARCH_PATH = os.environ.get("PATH", "") + ":/usr/sbin:/sbin"


@dataclass(frozen=True, slots=True)
class Parts:
    """Files of Debian's packages: the kernel, the folder of its modules, and a shell that needs no library."""

    kernel: Path
    modules: Path
    busybox: Path


def find_parts(folder: Path) -> Parts:
    """The guest's parts in `folder`; what is missing there, or on this machine, is fetched and stays.

    Raises GuestError where that cannot be done.
    """
    if platform.machine() != "x86_64":
        raise GuestError(f"The guest's kernel is for x86-64 and this is {platform.machine()}; run it on x86-64.")
    missing = [package for program, package in PROGRAMS.items() if shutil.which(program, path=SEARCH_PATH) is None]
    sudo = _sudo()
    if missing and sudo is None:
        raise GuestError(f"Install {' '.join(missing)} from Debian as root first; there is no sudo here.")
    if (missing or not folder.exists()) and sudo is not None:
        _run(*sudo, "apt-get", "update", "--quiet=2")
    if missing and sudo is not None:
        _run(*sudo, "apt-get", "install", "--quiet=2", "--yes", "--no-install-recommends", *missing)
    if not folder.exists():
        _unpack([_kernel_package(), "busybox-static"], folder)
    return Parts(
        kernel=next(folder.glob("boot/vmlinuz-*")),
        modules=next(folder.glob("lib/modules/*")),
        busybox=next(folder.glob("**/bin/busybox")),
    )


def _kernel_package() -> str:
    """The package that `linux-image-amd64` stands for today."""
    for line in _run("apt-cache", "depends", "linux-image-amd64").splitlines():
        _, is_found, package = line.partition("Depends: ")
        if is_found:
            return package
    raise GuestError("There is no package linux-image-amd64 here; make test-v4l2 needs Debian on x86-64.")


def _unpack(packages: list[str], folder: Path) -> None:
    # The folder gets its name when it is complete: what an interrupted run left is not taken for it.
    folder.parent.mkdir(exist_ok=True)
    with TemporaryDirectory(dir=folder.parent) as scratch:
        root = Path(scratch) / "root"
        # As root, apt-get would hand the download to a user who may not write here.
        _run("apt-get", "download", "--quiet=2", "--option=APT::Sandbox::User=root", *packages, cwd=Path(scratch))
        for package in Path(scratch).glob("*.deb"):
            _run("dpkg-deb", "--extract", str(package), str(root))
        if not (root / "lib").exists():  # since Debian 13
            (root / "lib").symlink_to("usr/lib")
        release = next(root.glob("lib/modules/*")).name
        _run("depmod", "--basedir", str(root), release)
        root.rename(folder)


def _sudo() -> list[str] | None:
    """What makes a command root's; None where nothing does. A download needs no root, a fresh list of packages does."""
    if os.geteuid() == 0:
        return []
    return ["sudo"] if shutil.which("sudo") is not None else None


def _run(*command: str, cwd: Path | None = None) -> str:
    """What `command` wrote. Raises GuestError when it cannot be run, or fails."""
    try:
        result = subprocess.run(
            command, cwd=cwd, env={**os.environ, "PATH": SEARCH_PATH}, stdout=subprocess.PIPE, text=True, check=True
        )
    except FileNotFoundError:
        raise GuestError(f"There is no {command[0]} here; make test-v4l2 needs Debian on x86-64.") from None
    except subprocess.CalledProcessError as error:
        raise GuestError(
            f"'{' '.join(command)}' failed with {error.returncode}; see above, or run it yourself."
        ) from None
    return result.stdout
