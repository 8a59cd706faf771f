"""Memory of a service that runs on: its threads share two heaps of the C library, and what is left in cycles is collected."""

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

#: Bodies in cycles that outlive two collections beside a library's objects, of which the last ones are held; tells how many are there.
CYCLES = """
import gc, sys, weakref
from collections import deque
from api.processes import leave_out_what_stays

library = [[] for _ in range(1_000_000)]
gc.collect()
if sys.argv[1] == "left out":
    leave_out_what_stays()

class Request:
    pass

there, held = weakref.WeakSet(), deque(maxlen=20_000)
for _ in range(200_000):
    request = Request()
    request.itself = request
    there.add(request)
    held.append(request)
print(len(there))
"""


def test_what_requests_leave_in_cycles_is_collected_beside_the_libraries():
    there = {}
    for how in ("left out", "beside"):
        command = [sys.executable, "-c", CYCLES, how]
        there[how] = int(subprocess.run(command, check=True, capture_output=True, text=True, timeout=60).stdout)
    assert 2 * there["left out"] < there["beside"]


@pytest.mark.skipif(sys.platform != "linux", reason="heaps of glibc")
def test_threads_share_two_heaps(tmp_path):
    heaps = {}
    for how in ("shared", "apart"):
        command = [sys.executable, "-c", COUNT, how, str(tmp_path / how)]
        heaps[how] = int(subprocess.run(command, check=True, capture_output=True, text=True, timeout=60).stdout)
    assert heaps["shared"] <= 2 < heaps["apart"]
