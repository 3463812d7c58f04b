"""ImportError where a wheel of tools/wheel meets a processor that cannot run it.

Such a wheel has a file `needs` with names of instruction sets, as in the flags of /proc/cpuinfo.
"""

import os

_FILE = os.path.join(os.path.dirname(os.path.abspath(__file__)), "needs")


def missing(needs: str, cpuinfo: str) -> list[str]:
    """The instruction sets that are needed and not among the flags; none where none are listed."""
    flags = [line.split(":")[1].split() for line in cpuinfo.splitlines() if line.startswith("flags")]
    return [name for name in needs.split() if flags and name not in flags[0]]


def _check() -> None:
    if not os.path.exists(_FILE) or not os.path.exists("/proc/cpuinfo"):
        return
    with open(_FILE, encoding="ascii") as needs, open("/proc/cpuinfo", encoding="utf-8") as info:
        lacks = missing(needs.read(), info.read())
    if lacks:
        raise ImportError(
            f"limn: this processor lacks {', '.join(lacks)}, which this wheel needs: build limn from "
            "its source, by pip install . in a clone"
        )


_check()
