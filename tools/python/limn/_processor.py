"""Which build of a wheel this processor runs; ImportError where it runs none.

A wheel of tools/wheel has two: one beside this file, and one in `v4` for x86-64-v4 (AVX-512). Each
has a file `needs` with names of instruction sets, as in the flags of /proc/cpuinfo.
"""

import os

_FOLDER = os.path.dirname(os.path.abspath(__file__))


def missing(needs: str, cpuinfo: str) -> list[str]:
    """The instruction sets that are needed and not among the flags; none where none are listed."""
    flags = [line.split(":")[1].split() for line in cpuinfo.splitlines() if line.startswith("flags")]
    return [name for name in needs.split() if flags and name not in flags[0]]


def _lacks(folder: str) -> list[str] | None:
    """None where it is not known."""
    file = os.path.join(folder, "needs")
    if not os.path.exists(file) or not os.path.exists("/proc/cpuinfo"):
        return None
    with open(file, encoding="ascii") as needs, open("/proc/cpuinfo", encoding="utf-8") as info:
        return missing(needs.read(), info.read())


def choose() -> list[str]:
    """Folders to look for the module in before this one: that of the faster build, or none."""
    lacks = _lacks(_FOLDER)
    if lacks:
        raise ImportError(
            f"limn: this processor lacks {', '.join(lacks)}, which this wheel needs: build limn from "
            "its source, by pip install . in a clone"
        )
    fast = os.path.join(_FOLDER, "v4")
    return [fast] if _lacks(fast) == [] else []


def program() -> str:
    """The program of the same build."""
    return os.path.join(_FOLDER, "bin", "limn-v4" if choose() else "limn")
