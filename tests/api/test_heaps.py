"""The service's threads share two heaps of the C library; each thread would keep its own one free."""

import subprocess
import sys

import pytest

COUNT = """
import ctypes, sys, threading
from api.processes import share_heaps

if sys.argv[1] == "shared":
    share_heaps()
together = threading.Barrier(8)

def work():
    held = [bytearray(2000) for _ in range(100)]
    together.wait()
    held.clear()

threads = [threading.Thread(target=work) for _ in range(8)]
for each in threads:
    each.start()
for each in threads:
    each.join()
libc = ctypes.CDLL(None)
libc.fopen.restype = ctypes.c_void_p
file = ctypes.c_void_p(libc.fopen(sys.argv[2].encode(), b"w"))
libc.malloc_info(0, file)
libc.fclose(file)
print(open(sys.argv[2]).read().count("<heap nr="))
"""


@pytest.mark.skipif(sys.platform != "linux", reason="heaps of glibc")
def test_threads_share_two_heaps(tmp_path):
    heaps = {}
    for how in ("shared", "apart"):
        command = [sys.executable, "-c", COUNT, how, str(tmp_path / how)]
        heaps[how] = int(subprocess.run(command, check=True, capture_output=True, text=True, timeout=60).stdout)
    assert heaps["shared"] <= 2 < heaps["apart"]
