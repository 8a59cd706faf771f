"""From nothing to the first page: a fresh virtual environment, the package, the service, seconds at each step.

Run outside the other claims, since it installs from the package registry: ``python -m benchmarks first_page``.
"""

from __future__ import annotations

import argparse
import os
import socket
import subprocess
import sys
import tempfile
import time
import urllib.request
from collections.abc import Callable, Sequence
from pathlib import Path
from urllib.error import URLError

ROOT = Path(__file__).resolve().parents[1]
#: Seconds after which something is wrong.
LONGEST = 600.0


def main(arguments: Sequence[str]) -> None:
    """Print the seconds from the command to the environment, the installed package, the page, and a service that computes."""
    argparse.ArgumentParser(prog="benchmarks first_page", description=__doc__).parse_args(arguments)
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        told("virtual environment", lambda: subprocess.run([sys.executable, "-m", "venv", str(place / "venv")], check=True))
        binaries = place / "venv" / "bin"
        told("pip install .", lambda: subprocess.run([str(binaries / "pip"), "install", "-q", str(ROOT)], check=True))
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            port = int(free.getsockname()[1])
        # compiled kernels of the checkout would make a fresh start look faster than it is
        environment = {**os.environ, "NUMBA_CACHE_DIR": str(place / "kernels")}
        for round in ("first start", "second start"):
            start = time.perf_counter()
            words = [str(binaries / "rcsa-ident-serve"), "--data", str(place / "data"), "--port", str(port)]
            with subprocess.Popen(words, env=environment, cwd=place, stderr=subprocess.DEVNULL) as service:
                try:
                    for path, what in (("/", "page"), ("/ready", "ready to compute")):
                        wait(f"http://127.0.0.1:{port}{path}", start)
                        print(f"{round} to {what:<20} {time.perf_counter() - start:8.1f} s", flush=True)
                finally:
                    service.terminate()


def told(what: str, call: Callable[[], object]) -> None:
    """Print how long a step takes."""
    start = time.perf_counter()
    call()
    print(f"{what:<36} {time.perf_counter() - start:8.1f} s", flush=True)


def wait(url: str, start: float) -> None:
    """Return when an address answers with 200."""
    while time.perf_counter() - start < LONGEST:
        try:
            with urllib.request.urlopen(url, timeout=10.0) as answer:
                if answer.status == 200:
                    return
        except (URLError, OSError):
            time.sleep(0.05)
    raise RuntimeError(f"no answer from {url}")
