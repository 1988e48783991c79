"""Run the tests of pages in a browser; Chromium is installed from Debian where it is missing."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

from tests.page_browser.browser import find_chromium


def main() -> int:
    """Install what is missing, and test."""
    if find_chromium() is None:
        as_root = [] if os.geteuid() == 0 else ["sudo"]
        if as_root and shutil.which("sudo") is None:
            sys.stderr.write("Install chromium from Debian as root first; there is no sudo here.\n")
            return 2
        subprocess.run([*as_root, "apt-get", "update", "--quiet=2"], check=True)
        install = ["apt-get", "install", "--quiet=2", "--yes", "--no-install-recommends", "chromium"]
        subprocess.run([*as_root, *install], check=True, env={**os.environ, "DEBIAN_FRONTEND": "noninteractive"})
    tests = Path(__file__).parent / "browser_tests.py"
    return subprocess.run([sys.executable, "-m", "pytest", str(tests), *sys.argv[1:]], check=False).returncode


if __name__ == "__main__":
    sys.exit(main())
